"""Reactions of the driver to every fault of the plant in the middle of a campaign, as tables.

The faults occur over real frames of both buses, in lock-step; each row is a separate run
(`fault_table`). The script writes docs/reference/faults.md and fails if a row does not keep its
promise::

    python benchmarks/faults.py [--output docs/reference/faults.md]
"""

from __future__ import annotations

import argparse
import logging
import re
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "harness"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

from fault_table.cases import CASES
from fault_table.ethercat_cases import ETHERCAT_CASES
from fault_table.promise import CYCLES, tried
from fault_table.stop_cases import WAY
from fault_table.stopping_way import STOP_DELAY, STOP_MARGIN
from figures import Figure, keep

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fault_table.case import Case
    from fault_table.promise import Row
    from fault_table.trial import Outcome

DOCS = Path(__file__).parents[1] / "docs" / "reference" / "faults.md"
LONGEST = 60
"""Maximum length of a message in the table."""
ADDRESSED = re.compile(r"^(?:joint \d+ \(node \d+\)(?:, |: ))+")
REMEDY = "; "
"""Separator of finding and remedy in a message."""

INTRODUCTION = """\
# Faults and the reaction to each

What happens when something fails during a measurement? The driver commands all axes to stop within
{cycles} SYNCs of the first frame that shows the fault, and switches them off. Minor faults, such as
a lost telegram, flag the sample. {rows} faults were injected into a virtual plant of six axes over
frames of both buses, in lock-step at 250 Hz, during a stroke of joint 2, or of joint 1 at 2.4 rad/s
where speed matters.

| | all {rows} rows |
| --- | --- |
| reaction as described | {kept} |
| most SYNCs from the fault to the last command to stop | {slowest} |
| rows with an unsupervised axis | {unwatched} |
| rows with an axis energised or moving afterwards | {left} |
| rows with a wrong sample without flag, finding or note | {wrong} |

Not detected: an encoder jump below about 1 mrad, a current offset below 2 % of an axis's torque
limit, and a wrong torque constant.

## Columns

*Stops*: all axes are commanded to stop and switched off. A row of several cases has the largest
figures; a dash means that nothing has to be stopped or can be commanded.

- *stop*: SYNCs from the first frame that shows the fault (10 SYNCs without a TPDO, a heartbeat's
  timeout of 0.5 s, a request without an answer) to the last axis's command; 0: before the next.
- *off*: time [s] from the fault until no axis is energised.
- *path*: longest path [rad] of any axis from the fault or Ctrl-C to standstill.
- *the operator reads*: the finding of the first message; its remedy follows
  ([messages](messages.md)).

After an outage and after Ctrl-C the path is at most

    v (min(outage, heartbeat_timeout) + {delay:g} s) + {margin:g} v^2 / 2a + following_error_window,

with the axis's highest speed v before the stop and its stated deceleration a
(`limits.acceleration`). A drive that ignores the command to stop travels at most {longest:g} rad
from 2.4 rad/s.

An axis is *unsupervised* if it is energised for more than one SYNC while its drive would not react
to the loss of the driver's heartbeat (object 1016).

`python benchmarks/faults.py` writes this page from the checkout, and the tests check every row.
`python benchmarks/outages.py` draws a thousand outages at random (length, direction, moment,
adapter or one drive, with and without Ctrl-C), with the bounds of this page.

## Inject a fault

`python -m sim_plant --faults FILE` serves a plant with a plan of faults:

```yaml
faults:
  - {{what: tpdo-lost, axis: 2, at: {{set_point: 3, after: 0.2}}, lasts: {{syncs: 1}}}}
  - {{what: fault, axis: 1, code: 0x2310, at: {{time: 12.5}}}}
```

`at` is a time, the number of a SYNC or of a frame, or a stroke of a measurement (`set_point`, as
the axis receives it); `lasts` is a time or a number of SYNCs, and permanent if omitted.

## Over CAN

"""
OVER_ETHERCAT = """
## Over EtherCAT

Same plant, measurement and columns. A frame with process data counts as a SYNC; an axis is
unsupervised if the watchdog of its sync manager is off in OP, or if it is energised outside of OP
and does not stop. Inputs are latched by the previous frame, so a fault shows one frame later. The
{drives} faults of drives, sensors and motors above have the same reaction here, with at most
{latest} SYNCs to stop.

EtherCAT does not show what another participant writes. The driver therefore reads the watchdogs'
registers with every `heartbeat_period` (0.1 s), restores them and stops the axes, and reads one
limit of each drive back before each move, the next one each time. Random outages:
`python benchmarks/ethercat_outages.py`.

"""
HEADINGS = ("fault", "reaction", "stop", "off, s", "path, rad", "the operator reads")


def main() -> int:
    """Return 0 if every row keeps its promise."""
    parser = argparse.ArgumentParser(description="The fault table.")
    parser.add_argument("--output", type=Path, default=DOCS)
    given = parser.parse_args()
    logging.disable()  # the table has the messages of the driver's log
    signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in the background
    can, ethercat = _rows(CASES), _rows(ETHERCAT_CASES, ethercat=True)
    given.output.write_text(page(can, ethercat), encoding="utf-8")
    rows = [*can, *ethercat]
    kept = sum(not row.broken for row in rows)
    slowest = max(row.outcome.cycles or 0 for row in rows)
    unwatched = sum(bool(row.outcome.unwatched) for row in rows)
    print(f"{kept} of {len(rows)} faults survived as described, stopped within {slowest} SYNCs")
    print(f"{unwatched} with an axis energised while its watchdog was off")
    counts = {
        "cases-can": len(can), "cases-ethercat": len(ethercat), "kept": kept,
        "broken": len(rows) - kept, "most-syncs-to-stop": slowest, "unwatched": unwatched,
    }  # fmt: skip
    keep(
        "faults", {name: Figure.count(number) for name, number in counts.items()},
        depends=("drivers", "sim_plant/faults", "tests/harness/fault_table"),
        command="python benchmarks/faults.py",
    )  # fmt: skip
    return int(kept < len(rows))


def _rows(cases: Sequence[Case], *, ethercat: bool = False) -> list[Row]:
    """Cause all faults, and print broken promises."""
    rows = []
    for case in cases:
        row = tried(case, ethercat=ethercat)
        rows.append(row)
        print(f"{'BROKEN' if row.broken else 'kept  '} {case.name}", flush=True)
        for promise in row.broken:
            print(f"         {promise}")
    return rows


def page(can: Sequence[Row], ethercat: Sequence[Row]) -> str:
    """Return the whole page."""
    rows = [*can, *ethercat]
    on_can = {(row.case.name, row.case.does) for row in can}
    of_drives = [row for row in ethercat if (row.case.name, row.case.does) in on_can]
    introduction = INTRODUCTION.format(
        cycles=CYCLES, delay=STOP_DELAY, margin=STOP_MARGIN, longest=WAY, rows=len(rows),
        kept=sum(not row.broken for row in rows), slowest=_largest(rows),
        unwatched=sum(bool(row.outcome.unwatched) for row in rows),
        left=sum(not row.outcome.off for row in rows),
        wrong=sum(bool(row.outcome.wrong) and not row.case.noted for row in rows),
    )  # fmt: skip
    over_ethercat = OVER_ETHERCAT.format(drives=len(of_drives), latest=_largest(of_drives))
    others = [row for row in ethercat if row not in of_drives]
    return introduction + table(can) + over_ethercat + table(others)


def table(rows: Sequence[Row]) -> str:
    """Return a table with one line for all rows of a kind."""
    kinds: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        kinds.setdefault((row.case.kind or row.case.name, row.case.does), []).append(row)
    head = _cells(HEADINGS) + _cells(["---"] * len(HEADINGS))
    return head + "".join(_line(*kind, members) for kind, members in kinds.items())


def _line(name: str, reaction: str, rows: Sequence[Row]) -> str:
    stopped = [row.outcome for row in rows if row.outcome.error and row.case.energised is not False]
    off = path = "-"
    if stopped:
        after = [outcome.off_after for outcome in stopped]
        off = "never" if None in after else f"{max(filter(None, after), default=0.0):.2f}"
        path = f"{max(outcome.ways.max() for outcome in stopped):.3f}"
    lengths = sorted({1000 * row.case.outage for row in rows})
    named = name.format(" to ".join(f"{length:.0f}" for length in {lengths[0]: 0, lengths[-1]: 0}))
    return _cells((named, reaction, _largest(rows), off, path, _read_by_operator(rows[0].outcome)))


def _largest(rows: Sequence[Row]) -> str:
    """Return the largest number of SYNCs until the last axis was commanded to stop."""
    cycles = [row.outcome.cycles for row in rows if row.outcome.cycles is not None]
    return str(max(cycles)) if cycles else "-"


def _cells(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |\n"


def _read_by_operator(outcome: Outcome) -> str:
    """Return the finding of the first message, without the joint's name and the remedy."""
    first = next(filter(None, outcome.text.splitlines()), "")
    finding = ADDRESSED.sub("", first).split(REMEDY)[0]
    return finding if len(finding) <= LONGEST else finding[:LONGEST].rsplit(" ", 1)[0] + " ..."


if __name__ == "__main__":
    sys.exit(main())
