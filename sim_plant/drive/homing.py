"""Homing mode (6): search of the reference position by the drive.

Methods (6098h): 35 and 37 take the present position. 17 and 18 use the negative and the positive
limit switch: the axis moves towards the switch at speed 6099h:1, then back at 6099h:2 until the
switch opens, which is the home position. The switches are at the software limits that the drive had
at power-on. The home position gets the value of 607Ch, and all shown positions shift with it.

A rising edge of bit 4 starts homing; a falling edge of bit 4, or halt, stops it. Statusword bit 12
reports the reference, bit 10 an axis at rest.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

from sim_plant.drive.cia402_states import Control, Status
from sim_plant.drive.motion import Motion, Ramp

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.machine_protocol import Reading

NEGATIVE_SWITCH, POSITIVE_SWITCH, PRESENT, PRESENT_POSITION = 17, 18, 35, 37
METHODS = (NEGATIVE_SWITCH, POSITIVE_SWITCH, PRESENT, PRESENT_POSITION)
_BEYOND = 2
"""Distance of the search target, in ranges of travel."""


class _Phase(enum.Enum):
    IDLE = enum.auto()
    SEEKING = enum.auto()
    LEAVING = enum.auto()
    ATTAINED = enum.auto()


class Homing:
    """State of the mode; methods as in `ProfilePosition`."""

    def __init__(
        self,
        dictionary: ObjectDictionary,
        motion: Motion,
        settings: DriveSettings,
        image: AxisImage,
    ) -> None:
        self._dictionary = dictionary
        self._motion = motion
        self._image = image
        self._switches = settings.software_limits
        self._controlword = 0
        self._phase = _Phase.IDLE
        dictionary.allow(0x6098, METHODS)

    def show(self) -> int:
        """Return the mode's bits of the statusword."""
        resting = self._motion.is_at_rest and self._phase not in (_Phase.SEEKING, _Phase.LEAVING)
        attained = self._phase is _Phase.ATTAINED
        return (Status.TARGET_REACHED if resting else 0) | (
            Status.SET_POINT_ACKNOWLEDGE if attained else 0
        )

    def start(self, _demand: int, controlword: int) -> None:
        """Start without a reference; bit 4 must rise again."""
        self.abandon()
        self._controlword = controlword

    def abandon(self) -> None:
        """Abandon the running search."""
        self._phase = _Phase.IDLE
        self._image.expect_nothing()

    def control(self, controlword: int) -> None:
        """Process a new controlword while operation is enabled."""
        risen, fallen = controlword & ~self._controlword, self._controlword & ~controlword
        self._controlword = controlword
        searching = self._phase in (_Phase.SEEKING, _Phase.LEAVING)
        if searching and (fallen & Control.NEW_SET_POINT or controlword & Control.HALT):
            self.abandon()
            self._motion.stop(Ramp.QUICK_STOP)
        elif risen & Control.NEW_SET_POINT and not controlword & Control.HALT:
            self._begin()

    def observe(self, reading: Reading) -> None:
        """Process latched readings: the limit switch closes, or opens again."""
        closed = self._beyond(reading.position)
        if self._phase is _Phase.SEEKING and closed:
            self._phase = _Phase.LEAVING
            self._search(-self._side, 2)
        elif self._phase is _Phase.LEAVING and not closed and self._returning(reading):
            self._motion.stop(Ramp.QUICK_STOP)
            self._attain(self._switch)

    def progress(self) -> None:
        """Ignore changes of axis events, unused in this mode."""

    def _begin(self) -> None:
        if self._dictionary.get(0x6098) in (PRESENT, PRESENT_POSITION):
            self._attain(self._image.reading.position)
        else:
            self._phase = _Phase.SEEKING
            self._image.expect_anything()
            self._search(self._side, 1)

    def _search(self, side: int, speed: int) -> None:
        low, high = self._switches
        target = self._switch + side * _BEYOND * (high - low)
        velocity, acceleration = self._motion.homing_pace(speed)
        self._motion.move(target, velocity, acceleration, acceleration)

    def _attain(self, position: int) -> None:
        """Define `position` as home."""
        shift = self._dictionary.get(0x607C) - position
        self._motion.rebase(shift)
        low, high = self._switches
        self._switches = (low + shift, high + shift)
        self._phase = _Phase.ATTAINED
        self._image.expect_nothing()

    @property
    def _side(self) -> int:
        return -1 if self._dictionary.get(0x6098) == NEGATIVE_SWITCH else 1

    @property
    def _switch(self) -> int:
        return self._switches[0] if self._side < 0 else self._switches[1]

    def _beyond(self, position: int) -> bool:
        return (position - self._switch) * self._side >= 0

    def _returning(self, reading: Reading) -> bool:
        return reading.velocity * self._side < 0
