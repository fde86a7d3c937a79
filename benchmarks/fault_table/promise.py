"""Whether what came of a fault is what its row of the table promises."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from fault_table.trial import run, stop_cycles

if TYPE_CHECKING:
    from fault_table.cases import Case
    from fault_table.trial import Outcome

CYCLES = 2
"""Within so many SYNCs of the frame that shows a fault all axes are commanded to stop."""


class Row(NamedTuple):
    """A case, what came of it, and which promises were broken."""

    case: Case
    outcome: Outcome
    broken: list[str]


def tried(case: Case) -> Row:
    """Let it happen."""
    outcome, bus = run(case.faults)
    if case.shown and bus.began is not None:
        outcome.cycles = stop_cycles(bus.log, case.shown(bus.log, bus.began))
    return Row(case, outcome, _broken(case, outcome))


def _broken(case: Case, outcome: Outcome) -> list[str]:
    ended = outcome.error is None if case.error is None else isinstance(outcome.error, case.error)
    stopped = outcome.cycles is not None and outcome.cycles <= CYCLES
    known = not outcome.wrong or (case.noted and case.reads in "\n".join(outcome.notes))
    promises = {
        f"ends with {case.error}, not {outcome.error!r}": ended,
        f"the operator reads {case.reads!r} in {outcome.told!r}": case.reads in outcome.told,
        f"{outcome.wrong} samples are wrong and not flagged": known,
        f"the check {case.finding} finds it": not case.finding or case.finding in outcome.findings,
        "samples are flagged": bool(outcome.flagged) or not case.flags,
        f"commanded to stop after {outcome.cycles} SYNCs": stopped or case.shown is None,
        f"energised: {outcome.energised}": outcome.energised == case.energised,
        "all axes are off": outcome.off,
        "recorded to the end": bool(outcome.kept) or case.error is not None,
    }
    return [promise for promise, kept in promises.items() if not kept]
