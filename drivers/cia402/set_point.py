"""Set-point handshake of profile position mode, as a pure state machine.

A target takes effect by a handshake of two bits: the master raises "new set-point" (6040 bit 4)
while "set-point acknowledge" (6041 bit 12) is low, the drive answers with bit 12, the master drops
bit 4, the drive drops bit 12. Until then "target reached" (bit 10) may be a remainder of the move
before, and a move of zero length may never clear it. So a move counts as finished only after the
whole handshake, with bit 10 set, the measured position inside the window and the axis at rest.

Positions are in the drive's units. The module has no frames and no time: `step` is called once for
each statusword.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.cia402.states import Command, Control, Status

if TYPE_CHECKING:
    from drivers.axis import Axis

ENABLED = Command.ENABLE_OPERATION.value[0]
HALTED = ENABLED | Control.HALT
RAISED = ENABLED | Control.NEW_SET_POINT | Control.CHANGE_IMMEDIATELY
_ACKNOWLEDGE = int(Status.SET_POINT_ACKNOWLEDGE)
_REACHED = int(Status.TARGET_REACHED)


class Phase(enum.Enum):
    """Progress of a set-point."""

    WAITING = "waiting for the acknowledge bit of an earlier set-point to fall"
    OFFERED = "offered, waiting for the drive to acknowledge it"
    TAKEN = "acknowledged, waiting for the drive to be ready for another"
    TRAVELLING = "on the way"
    REACHED = "reached"


@dataclass(slots=True)
class Standstill:
    """Detector of standstill from positions.

    An axis rests when its position stayed within `band` of one value for `count` samples.

    Attributes
    ----------
    band : float
        Half width [increments].
    count : int
        Number of samples, at least 1.
    """

    band: float
    count: int
    _anchor: float = field(default=float("inf"), init=False)
    _still: int = field(default=0, init=False)

    def update(self, position: float) -> bool:
        """Evaluate a position; return True while the axis rests."""
        if abs(position - self._anchor) > self.band:
            self._anchor = position
            self._still = 0
        self._still += 1
        return self._still > self.count


def standstill_of(axis: Axis, period: float) -> Standstill:
    """Return a standstill detector as in the drive of an axis, for a `period` of samples [s]."""
    return Standstill(axis.band, max(1, round(axis.drive.position_window_time / period)))


@dataclass(slots=True)
class SetPoint:
    """Set-point on its way to a drive.

    Attributes
    ----------
    target : int
        Target position (607A) [increments].
    window : float
        Largest distance from the target to count as reached [increments].
    rest : Standstill
        Standstill detector of the axis.
    phase : Phase
        Progress of the set-point.
    """

    target: int
    window: float
    rest: Standstill
    phase: Phase = Phase.WAITING

    def waits(self, statusword: int) -> bool:
        """Return True while nothing is due before the statusword changes."""
        return self.phase is Phase.TRAVELLING and not statusword & _REACHED

    def step(self, statusword: int, position: int) -> int | None:
        """Evaluate statusword (6041) and position (6064); return a controlword to send, if any."""
        if self.phase is not Phase.TRAVELLING:
            self.rest.update(position)
            match self.phase, bool(statusword & _ACKNOWLEDGE):
                case Phase.WAITING, False:
                    self.phase = Phase.OFFERED
                    return RAISED
                case Phase.OFFERED, True:
                    self.phase = Phase.TAKEN
                    return ENABLED
                case Phase.TAKEN, False:
                    self.phase = Phase.TRAVELLING
            return None
        arrived = abs(position - self.target) <= self.window and self.rest.update(position)
        if arrived and statusword & _REACHED:
            self.phase = Phase.REACHED
        return None


@dataclass(slots=True)
class HaltedAxis:
    """Axis commanded to come to rest, with the interface of `SetPoint`.

    Attributes
    ----------
    rest : Standstill
        Standstill detector of the axis.
    phase : Phase
        TRAVELLING, then REACHED.
    """

    rest: Standstill
    phase: Phase = Phase.TRAVELLING

    def step(self, statusword: int, position: int) -> int | None:
        """Evaluate statusword and position; never returns a controlword."""
        del statusword
        if self.rest.update(position):
            self.phase = Phase.REACHED
        return None
