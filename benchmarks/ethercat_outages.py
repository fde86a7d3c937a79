"""Random outages over EtherCAT: no axis stays energised, and no axis moves beyond its bound.

Bounds and moves are those of `benchmarks/outages.py` over CAN. Outages last 5 to 250 ms: all frames
to the drives, from the drives, or both are lost; up to one frame in five is lost; the cable is cut
in front of a drive; or a drive falls to SAFEOP with an error. In half of the sessions Ctrl-C is
pressed at that moment. The exit status is 1 if a promise is broken::

    python benchmarks/ethercat_outages.py [--number 900] [--seed 1]
"""

from __future__ import annotations

import argparse
import logging
import signal
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "harness"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from ethercat_outages.session import results
from figures import keep


def main() -> int:
    """Return 0 if every promise is kept."""
    from outages import report

    # background jobs of a shell ignore the signal of Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)
    parser = argparse.ArgumentParser(description="Random outages over EtherCAT.")
    parser.add_argument("--number", type=int, default=900)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    logging.disable()  # log of the driver, with a message for every ended session
    found = results(given.seed, range(given.number))
    keep(
        "ethercat-outages", report(found), seeds=[given.seed],  # type: ignore[arg-type]
        depends=("drivers/ethercat", "drivers/cia402", "drivers/session", "drivers/safety"),
        command=f"python benchmarks/ethercat_outages.py --number {given.number} --seed"
        f" {given.seed}",
    )  # fmt: skip
    return int(any(verdict.broken for _, verdict in found))


if __name__ == "__main__":
    sys.exit(main())
