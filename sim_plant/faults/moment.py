"""Start and end of faults, counted in time, frames, SYNCs and set-points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_plant.faults.fault_plan import Fault


@dataclass(slots=True)
class Progress:
    """Progress of a session since power-on.

    Attributes
    ----------
    time : float
        Since power-on [s].
    frames, syncs : int
        Numbers sent by the master, including the present frame, also if lost.
    set_points : dict of int to int
        Number of set-points by axis, from 1.
    between : bool
        True if the present frame is no SYNC.
    """

    time: float = 0.0
    frames: int = 0
    syncs: int = 0
    set_points: dict[int, int] = field(default_factory=dict)
    between: bool = False


class Watch:
    """Detection of a fault's start and end."""

    def __init__(self, fault: Fault) -> None:
        self._fault = fault
        self._triggered: float | None = None
        self._begun: tuple[float, int] | None = None
        self.over = False

    def present(self, progress: Progress) -> bool:
        """Update by the progress; return True if the fault is present."""
        if self.over:
            return False
        if self._begun is None:
            self._begun = self._begin(progress)
        self.over = self._begun is not None and self._ended(progress, *self._begun)
        return self._begun is not None and not self.over

    def _begin(self, progress: Progress) -> tuple[float, int] | None:
        if self._triggered is None and self._reached(progress):
            at = self._fault.at.time
            self._triggered = progress.time if at is None else at
        if self._triggered is None or progress.time < self._triggered + self._fault.at.after:
            return None
        return progress.time, progress.syncs + progress.between

    def _reached(self, progress: Progress) -> bool:
        at, axis = self._fault.at, self._fault.axis
        if at.time is not None:
            return progress.time >= at.time
        if at.sync is not None:
            return progress.syncs >= at.sync
        if at.frame is not None:
            return progress.frames >= at.frame
        given = progress.set_points
        count = sum(given.values()) if axis is None else given.get(axis, 0)
        return count >= (at.set_point or 0)

    def _ended(self, progress: Progress, time: float, syncs: int) -> bool:
        lasts = self._fault.lasts
        if lasts is None:
            return False
        if lasts.syncs is not None:
            return progress.syncs >= syncs + lasts.syncs
        return progress.time >= time + (lasts.time or 0.0)
