"""Comparison of the result of a fault with the promise of its row in the table."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fault_table.stopping_way import allowed_ways
from fault_table.trial import drives, run, stop_cycles

if TYPE_CHECKING:
    from fault_table.cases import Case
    from fault_table.trial import Outcome

CYCLES = 2
"""Largest number of SYNCs from the first sign of a fault to the stop command of all axes."""


class Row(NamedTuple):
    """A case, its outcome, and the broken promises."""

    case: Case
    outcome: Outcome
    broken: list[str]


def tried(case: Case, *, ethercat: bool = False) -> Row:
    """Run the case, over CAN by default."""
    outcome, bus = run(case, ethercat=ethercat)
    if case.shown and bus.began is not None:
        outcome.cycles = stop_cycles(bus.log, case.shown(bus.log, bus.began))
    return Row(case, outcome, _broken(case, outcome))


def _broken(case: Case, outcome: Outcome) -> list[str]:
    goes_on = outcome.error is None
    ended = isinstance(outcome.error, case.error) if case.error else goes_on
    stopped = outcome.cycles is not None and outcome.cycles <= CYCLES
    known = not outcome.wrong or (case.noted and case.reads in "\n".join(outcome.notes))
    promises = {
        f"ends with {case.error}, not {outcome.error!r}": ended or (goes_on and case.may_go_on),
        f"the operator reads {case.reads!r} in {outcome.text!r}": case.reads in outcome.text,
        f"{outcome.wrong} samples are wrong and not flagged": known,
        f"the check {case.finding} finds it": not case.finding or case.finding in outcome.findings,
        "samples are flagged": bool(outcome.flagged) or not case.flags,
        f"commanded to stop after {outcome.cycles} SYNCs": stopped or case.shown is None,
        f"energised: {outcome.energised}": case.energised in (None, outcome.energised),
        "all axes are off": outcome.off,
        f"axes {sorted(outcome.unwatched)} energised with the watchdog off": not outcome.unwatched,
        **_stop_promises(case, outcome),
        "recorded to the end": bool(outcome.kept) or not goes_on,
    }
    return [promise for promise, kept in promises.items() if not kept]


def _stop_promises(case: Case, outcome: Outcome) -> dict[str, bool]:
    """Return promises on distance and time, each with True if it was kept."""
    promises = {}
    if outcome.error is not None and (case.interrupted or case.outage):
        allowed = allowed_ways(outcome.speeds, case.outage, drives)
        if case.way is not None:
            allowed = np.full_like(allowed, case.way)
        worst = int(np.argmax(outcome.ways / allowed))
        way = f"axis {worst + 1} goes {outcome.ways[worst]:.3f} rad, allowed {allowed[worst]:.3f}"
        promises[way] = bool(outcome.ways[worst] <= allowed[worst])
    if case.off_within is not None:
        off = f"off after {outcome.off_after} s, allowed {case.off_within} s"
        promises[off] = outcome.off_after is not None and outcome.off_after <= case.off_within
    return promises
