"""Row of the fault table: events, first sign of the fault, promised reaction."""

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
"""Instant in the second stroke; the first set-point is the move to the start."""


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes
    ----------
    name, does : str
        Event, and reaction of the driver.
    faults : tuple of Fault
    error : type or None
        Error that ends the campaign; None if it is completed.
    reads : str
        Part of the message to the operator.
    shown : callable, optional
        Function that finds the first frame with a sign of the fault, if axes must be stopped.
    findings : str, optional
        Check that finds a recording unfit.
    flags : bool
        True if samples are flagged one by one.
    noted : bool
        True if defects of all samples of a session are noted with the session.
    may_go_on : bool
        True if the campaign may also be completed, depending on the affected frame.
    energised : bool, optional
        True if axes had power at any time; None if irrelevant.
    plan : Plan
        Plan of the campaign.
    condition : callable, optional
        Condition of our frame at which the faults begin, in place of a count of set-points.
    interrupted : bool
        True if Ctrl-C is pressed at the begin of the first fault.
    outage : float
        Duration of the outage, for the bound on distance [s].
    way : float, optional
        Largest permitted distance of an axis after the event [rad]; for Ctrl-C or an outage, by
        default `fault_table.stopping_way.allowed_ways`.
    off_within : float, optional
        Largest time from the event until all axes are off [s].
    foreign : tuple of (int, bytes)
        Identifiers and data of frames sent once by another participant, in the second stroke.
    changed : callable, optional
        Change in the axis's drive by another participant in the second stroke, over EtherCAT.
    unnoticed : float
        Time for which a drive may be unwatched after `changed` [s].
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
    """Return a fault of one axis."""
    whole = {"what": what, "axis": axis, "at": at, "lasts": lasts, **more}
    return Fault.model_validate(whole)


def everywhere(
    what: What, at: When = MID_STROKE, lasts: Span | None = None, size: float | None = None
) -> Fault:
    """Return a fault that concerns no single axis."""
    return Fault(what=what, at=at, lasts=lasts, size=size)
