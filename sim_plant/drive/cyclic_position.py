"""Cyclic synchronous position mode (8): the master plans, the drive follows set-point by set-point.

Each write of the target position (607Ah) is a set-point; the drive interpolates towards it over the
interpolation time period (60C2h, value and power of ten of a second), without a handshake. If the
next set-point is missing, the demand comes to rest at the last one within a further period. Before
the first set-point the axis holds its position, for any value of 607Ah. Where positions wrap around
(607Bh) a set-point means the nearest position with this shown value. Targets outside 607Dh are
clipped, and halt (bit 8) stops as configured in 605Dh. Statusword bit 12 reports that the drive
follows set-points.

The velocity offset (60B1h) and the torque offset (60B2h) are added to the commands of the loops as
long as the mode is followed, under halt too: each value is valid until the next one is written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.drive.cia402_states import Control, Status
from sim_plant.drive.motion import Motion, Ramp

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.machine_protocol import Reading

PERIOD = 0x60C2
OFFSETS = (0x60B1, 0x60B2)
_FOLLOWED = int(Status.SET_POINT_ACKNOWLEDGE)
_CLIPPED = int(Status.INTERNAL_LIMIT | Status.WARNING)


class CyclicPosition:
    """State of the mode; methods as in `ProfilePosition`."""

    def __init__(self, dictionary: ObjectDictionary, motion: Motion) -> None:
        self._dictionary = dictionary
        self._motion = motion
        self._active = False
        self._halted = False
        self._clipped = False
        self._load()
        dictionary.react(PERIOD, lambda _subindex, _value: self._load())
        dictionary.react(0x607D, lambda _subindex, _value: self._load())
        for offset in OFFSETS:
            dictionary.react(offset, lambda _subindex, _value: self._feed_forward())

    def show(self) -> int:
        """Return the mode's bits of the statusword."""
        if self._clipped:
            return _CLIPPED
        return 0 if self._halted else _FOLLOWED

    def start(self, _demand: int, controlword: int) -> None:
        """Start without a set-point."""
        self.abandon()
        self._load()
        self._halted = bool(controlword & Control.HALT)
        self._active = True
        self._feed_forward()

    def abandon(self) -> None:
        """Forget set-points and feed-forward."""
        if self._active:
            self._motion.feed_forward(0, 0)
        self._active = self._halted = self._clipped = False

    def control(self, controlword: int) -> None:
        """Process a new controlword while operation is enabled."""
        halted = bool(controlword & Control.HALT)
        if halted and not self._halted:
            self._motion.stop(Ramp(self._dictionary.get(0x605D)))
        self._halted = halted

    def follow(self, target: int) -> None:
        """Follow a set-point [increments]."""
        if self._halted:
            return
        clipped = min(max(target, self._low), self._high)
        self._clipped = clipped != target
        turns = self._motion.turns
        place = turns.nearest(clipped, self._motion.demand) if turns.size else clipped
        self._motion.follow(place, self._period)

    def observe(self, _reading: Reading) -> None:
        """Ignore latched readings, unused in this mode."""

    def progress(self) -> None:
        """Ignore changes of axis events, unused in this mode."""

    def _feed_forward(self) -> None:
        if self._active:
            self._motion.feed_forward(*map(self._dictionary.get, OFFSETS))

    def _load(self) -> None:
        dictionary = self._dictionary
        self._period = dictionary.get(PERIOD, 1) * 10.0 ** dictionary.get(PERIOD, 2)
        low, high = dictionary.get(0x607D, 1), dictionary.get(0x607D, 2)
        self._low, self._high = (low, high) if low < high else (-(2**31), 2**31 - 1)
