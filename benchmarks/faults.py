"""Every fault of the plant in the middle of a campaign: what the driver makes of it, as tables.

Over real frames of both buses, in lock-step; each row is a run of its own (`fault_table`). Writes
docs/reference/faults.md and fails if a row does not keep its promise::

    python benchmarks/faults.py [--output docs/reference/faults.md]
"""

from __future__ import annotations

import argparse
import logging
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
LONGEST = 220

INTRODUCTION = """\
# Faults, and what becomes of them

Each row is a run of its own on the virtual plant, over real CAN frames in lock-step at 250 Hz: six
axes powered, joint 2 in the second stroke of a gravity measurement, then the fault. Where speed
matters, joint 1 is in a stroke at 2.4 rad/s. The table is written by `python benchmarks/faults.py`,
and the tests check every row. Afterwards all axes stood still and were off, in every row, and no
recorded sample was wrong without a flag on it, a finding on its recording or a note with its
session (`run.json`).

*Stop* counts SYNCs from the first frame that shows the fault to the command to stop on the last
axis, at most {cycles} as measured from the log of all frames; 0 is before the next SYNC. What stays
away is shown by the frame at which the tolerance for it ends: 10 SYNCs without a TPDO, the
heartbeat's time-out of 0.5 s, a request without an answer. *Off* is the time from the fault until
no axis was energised any more, whether we switched it off or the drive did. A dash in *stop* stands
where nothing has to be stopped or nothing can be commanded. *Flagged* counts samples.

*Way* is the longest way of any axis from the fault (or from Ctrl-C, which is pressed at the same
moment) until it stands still, read from the machine. What an axis still moves on purpose before the
fault shows is part of it; a dash stands where the measurement goes on. After an outage and after
Ctrl-C it is at most

    v (min(outage, heartbeat_timeout) + {delay:g} s) + {margin:g} v^2 / 2a + following_error_window,

v being the axis's highest speed before anybody could stop it and a its stated deceleration
(`limits.acceleration`). Where a drive does not slow down when it is commanded to, the way is at
most {longest:g} rad at 2.4 rad/s.

*Unwatched* counts axes that were energised for longer than a SYNC while their drive would not have
reacted to the loss of our heartbeat, because object 1016 names none or the drive has not heard it
since; it is read from the machine and from the drives' own dictionaries at every frame, and must be
0 in every row. Where another participant takes us out of a drive's watch, the frame that does so is
heard, and the drive is set to watch us again before the next SYNC, while its axis is being stopped.

An outage is one of our adapter: frames are refused, or none arrives, for so long in the plant's
time; what the drives send, or we, passes in the other direction. `python benchmarks/outages.py`
draws a thousand of them at random (length, direction, moment, our adapter or one drive, with and
without Ctrl-C) while six axes move at up to full speed, and fails if an axis is left energised, is
ever unwatched, or goes farther than stated here.

Faults are injected by plan (`sim_plant/faults/fault_plan.py`):

```yaml
faults:
  - {{what: tpdo-lost, axis: 2, at: {{set_point: 3, after: 0.2}}, lasts: {{syncs: 1}}}}
  - {{what: fault, axis: 1, code: 0x2310, at: {{time: 12.5}}}}
```

`at` is a time, the number of a SYNC or of a frame, or a stroke of a measurement, which the plant
sees as the set-point of an axis; `lasts` is a time or a number of SYNCs, for good if left out.
`python -m sim_plant --faults FILE` serves a plant with such a plan.

Not found are a jump of an encoder by less than about a milliradian, a current offset below 2 % of
an axis's torque limit, and a wrong torque constant.

"""
OVER_ETHERCAT = """
## Over EtherCAT

The same plant, measurement and columns over EtherCAT frames in lock-step. A frame with process data
counts as a SYNC, and *unwatched* axes are those whose sync manager's watchdog is off in OP, or that
are energised outside of it and do not stop. A frame brings the inputs that were latched as the
frame before passed, so what a fault does shows a frame later. Faults of drives, sensors and motors
are those above. Nobody hears on EtherCAT that another participant writes a register or an object.
The registers of the watchdogs are read with every `heartbeat_period` (0.1 s), for which a drive may
be unwatched without being counted here, and are set again before the axes are stopped; a limit of
each drive is read back before each move, the next one each time. Random outages:
`python benchmarks/ethercat_outages.py`.

"""
HEADINGS = (
    "what happens",
    "what the driver does",
    "stop",
    "off, s",
    "way, rad",
    "unwatched",
    "flagged",
    "the operator reads",
)


def main() -> int:
    """Return 0 if every row keeps its promise."""
    parser = argparse.ArgumentParser(description="The fault table.")
    parser.add_argument("--output", type=Path, default=DOCS)
    given = parser.parse_args()
    logging.disable()  # what the driver logs stands in the table
    signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored
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
    """Let all happen, and print which promises are broken."""
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
    introduction = INTRODUCTION.format(
        cycles=CYCLES, delay=STOP_DELAY, margin=STOP_MARGIN, longest=WAY
    )
    return introduction + table(can) + OVER_ETHERCAT + table(ethercat)


def table(rows: Sequence[Row]) -> str:
    """Return the rows as a table."""
    head = _cells(HEADINGS) + _cells(["---"] * len(HEADINGS))
    return head + "".join(_line(row) for row in rows)


def _line(row: Row) -> str:
    case, outcome, _ = row
    stop = "-" if outcome.cycles is None else str(outcome.cycles)
    off = way = "-"
    if outcome.error is not None and case.energised is not False:
        off = "never" if outcome.off_after is None else f"{outcome.off_after:.2f}"
        way = f"{outcome.ways.max():.3f}"
    figures = (stop, off, way, str(len(outcome.unwatched)), str(outcome.flagged))
    return _cells((case.name, case.does, *figures, _read_by_operator(outcome)))


def _cells(texts: Sequence[str]) -> str:
    return f"| {' | '.join(texts)} |\n"


def _read_by_operator(outcome: Outcome) -> str:
    lines = dict.fromkeys(filter(None, outcome.text.splitlines()))
    return "<br>".join(_shortened(line) for line in lines)


def _shortened(line: str) -> str:
    return line if len(line) <= LONGEST else line[:LONGEST].rsplit(" ", 1)[0] + " ..."


if __name__ == "__main__":
    sys.exit(main())
