"""A thousand random outages: no axis stays energised, and no axis moves beyond its bound.

Each outage is a separate session on the virtual plant, over real frames in lock-step: all six axes
are powered up, moved three times at up to full speed and powered down. From a random frame after
the first SYNC on, the adapter stops transmitting, receiving or both, or one drive is disconnected,
for 5 to 250 ms; in half of the sessions Ctrl-C is pressed at that moment. Promises for all
sessions:

- no axis is ever energised while its drive would not react to the loss of our heartbeat;
- 3 s after the end no axis is energised;
- if the session ended, no axis moved farther after the event than ``v (min(outage,
  heartbeat_timeout) + delay) + margin v^2 / 2a + window`` (`fault_table.stopping_way`), v the
  highest speed of the axis before the first possible stop.

The exit status is 1 if a promise is broken; seed and number reproduce a session::

    python benchmarks/outages.py [--number 1000] [--seed 1] [--jobs 4] [--only NUMBER]
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import signal
import sys
from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "harness"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from figures import Figure, keep
from outage_sweep.draws import draw
from outage_sweep.session import frames_sent, happen

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from outage_sweep.draws import Outage
    from outage_sweep.session import Verdict

    Result = tuple[Outage, Verdict]

SHOWN = 20
"""Maximum number of broken promises printed one by one."""


def main() -> int:
    """Return 0 if every promise is kept."""
    # background jobs of a shell ignore the signal of Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser(description="Random outages.")
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=4, help="processes, which sleep a lot")
    parser.add_argument("--only", type=int, help="the draw of this number alone")
    given = parser.parse_args()
    logging.disable()  # log of the driver, with a message for every ended session
    numbers = range(given.number) if given.only is None else [given.only]
    results = list(_results(given.seed, numbers, given.jobs))
    only = "" if given.only is None else f" --only {given.only}"
    keep(
        "outages", report(results), seeds=[given.seed],
        depends=("drivers/canopen", "drivers/cia402", "drivers/session", "drivers/safety"),
        command=f"python benchmarks/outages.py --number {given.number} --seed {given.seed}{only}",
    )  # fmt: skip
    return int(any(verdict.broken for _, verdict in results))


def report(results: Sequence[Result]) -> dict[str, Figure]:
    """Print and return the results of all outages."""
    verdicts = [verdict for _, verdict in results]
    broken = [result for result in results if result[1].broken]
    for outage, verdict in broken[:SHOWN]:
        print(f"BROKEN {outage}: {verdict}")
    if len(broken) > SHOWN:
        print(f"... and {len(broken) - SHOWN} more")
    ended = Counter(verdict.ended or "none, it went on" for verdict in verdicts)
    print(f"{len(verdicts)} outages; the session was ended by:")
    for name, number in ended.most_common():
        print(f"  {number:5d}  {name}")
    counts = {
        "outages": len(verdicts),
        "ended": sum(bool(v.ended) for v in verdicts),
        "unwatched": sum(bool(v.unwatched) for v in verdicts),
        "energised": sum(bool(v.energised) for v in verdicts),
        "farther": sum(v.share > 1.0 for v in verdicts),
    }
    print(f"axis energised with its watchdog off: {counts['unwatched']}")
    print(f"axis energised 3 s after the end: {counts['energised']}")
    way = max(verdict.way for verdict in verdicts)
    outage, worst = max(results, key=lambda result: result[1].share)
    print(f"longest way after the event: {way:.3f} rad")
    print(f"largest share of the allowed way: {worst.share:.2f} ({worst.way:.3f} rad, {outage})")
    print(f"farther than allowed: {counts['farther']}")
    return {
        **{name: Figure.count(number) for name, number in counts.items()},
        "longest-way": Figure(way, "rad", 3),
        "largest-share": Figure(100 * worst.share, "%"),
    }


def _results(seed: int, numbers: Sequence[int], jobs: int) -> Iterator[Result]:
    one = partial(_result, seed, frames_sent())
    if min(jobs, len(numbers)) == 1:
        yield from map(one, numbers)
        return
    with multiprocessing.get_context("spawn").Pool(jobs, logging.disable) as pool:
        yield from pool.imap(one, numbers, chunksize=10)


def _result(seed: int, frames: range, number: int) -> Result:
    outage = draw(seed, number, frames)
    return outage, happen(outage)


if __name__ == "__main__":
    sys.exit(main())
