"""One row of the fault table: what happens, what shows it, what is promised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fault_table.trial import AXIS, SLOW
from sim_plant.faults.fault_plan import Fault, Span, What, When

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import DriveError
    from fault_table.logged_bus import Condition
    from fault_table.signs import Sign
    from hil.planning.plan import Plan

MID_STROKE = When(set_point=3, after=0.3)
"""In the second stroke; the first set-point is the travel to the start."""


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes
    ----------
    name, does : str
        What happens, and what the driver does about it.
    faults : tuple of Fault
    error : type or None
        What ends the campaign; None when it goes on to its end.
    reads : str
        What the operator reads, among other things.
    shown : callable, optional
        Finds the frame that shows the fault, where axes have to be stopped.
    findings : str, optional
        The check that finds a recording unfit.
    flags : bool
        Samples are flagged one by one.
    noted : bool
        What is wrong with the samples of a whole session is noted with it.
    may_go_on : bool
        It may go on to its end as well: it is a matter of the frame that is under way.
    energised : bool, optional
        Whether the axes were energised at all; None where that does not matter.
    plan : Plan
        What is measured meanwhile.
    condition : callable, optional
        Of the frame of ours with which the faults begin, where no count of set-points says it.
    interrupted : bool
        Ctrl-C is pressed at the same moment.
    outage : float
        For how long frames do not get through, as far as that matters for the way [s].
    way : float, optional
        Longest way that an axis may go after the event [rad]; where Ctrl-C or an outage is the
        event, it is `fault_table.stopping_way.allowed_ways` unless stated.
    off_within : float, optional
        Longest time from the event until all axes are off [s].
    foreign : tuple of (int, bytes)
        Identifiers and data of what another participant sends once, in the second stroke.
    changed : callable, optional
        What another participant changes in the drive of the axis at that time, over EtherCAT.
    unnoticed : float
        For how long that cannot be noticed [s].
    kind : str
        Name of all cases that share a line of the table; `{}` holds the lengths of outages.
    """

    name: str
    does: str
    faults: tuple[Fault, ...]
    error: type[DriveError | KeyboardInterrupt] | None
    reads: str
    shown: Sign | None = None
    finding: str = ""
    flags: bool = False
    noted: bool = False
    may_go_on: bool = False
    energised: bool | None = True
    plan: Plan = SLOW
    condition: Condition | None = None
    interrupted: bool = False
    outage: float = 0.0
    way: float | None = None
    off_within: float | None = None
    foreign: tuple[tuple[int, bytes], ...] = ()
    changed: Callable[[Any], None] | None = None
    unnoticed: float = 0.0
    kind: str = ""


def fault(
    what: What, at: When = MID_STROKE, lasts: Span | None = None, axis: int = AXIS, **more: float
) -> Fault:
    """Make a fault of one axis."""
    whole = {"what": what, "axis": axis, "at": at, "lasts": lasts, **more}
    return Fault.model_validate(whole)


def everywhere(
    what: What, at: When = MID_STROKE, lasts: Span | None = None, size: float | None = None
) -> Fault:
    """Make a fault of no axis."""
    return Fault(what=what, at=at, lasts=lasts, size=size)
