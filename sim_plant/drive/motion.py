"""Commands to the axis, and their completion.

Events reported before a command do not belong to the command, so each command discards them; the
next event or latched reading reports anew.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING

from sim_plant.drive.units import Turns, Units
from sim_plant.machine_protocol import AxisEvent

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.machine_protocol import Axis

_DONE = int(AxisEvent.DONE)
_COMPLETION = int(AxisEvent.DONE | AxisEvent.STANDSTILL)


class Ramp(enum.IntEnum):
    """Ways of stopping, numbered as in the option codes 605Ah to 605Eh."""

    NONE = 0
    """Remove the torque."""
    PROFILE = 1
    """Profile deceleration 6084h."""
    QUICK_STOP = 2
    """Quick stop deceleration 6085h."""
    CURRENT_LIMIT = 3
    """Hold the present position with the maximum torque."""


class Motion:
    """Axis within the limits of its dictionary.

    Attributes
    ----------
    turns : Turns
        Range of shown positions.
    """

    def __init__(
        self, dictionary: ObjectDictionary, axis: Axis, settings: DriveSettings, image: AxisImage
    ) -> None:
        self._dictionary = dictionary
        self._axis = axis
        self._counts_per_rev = settings.counts_per_revolution
        self._units = Units.derive(settings)
        self.turns = Turns.derive(settings)
        self._image = image

    @property
    def events(self) -> int:
        """`AxisEvent` bits known to belong to the last command."""
        return self._image.events

    @events.setter
    def events(self, bits: int) -> None:
        self._image.events = bits

    @property
    def demand(self) -> int:
        """Demand position at the last SYNC [increments]."""
        return self._image.reading.demand

    @property
    def done(self) -> bool:
        """True if the profile generator has finished the last command."""
        return bool(self.events & _DONE)

    @property
    def is_at_rest(self) -> bool:
        """True if demand and axis are at rest."""
        return self.events & _COMPLETION == _COMPLETION

    def enable(self) -> None:
        """Energise the axis."""
        self._forget()
        self._axis.enable()

    def disable(self) -> None:
        """Remove the torque."""
        self._axis.disable()

    def move(self, target: int, velocity: float, acceleration: float, deceleration: float) -> None:
        """Start a move to `target`."""
        self._forget()
        self._axis.move(target, velocity, acceleration, deceleration)

    def follow(self, target: int, period: float) -> None:
        """Lead the demand to `target` over `period` [s]."""
        self._forget()
        self._axis.follow(target, period)

    def feed_forward(self, velocity: int, torque: int) -> None:
        """Add to the commands of velocity [the drive's unit] and torque [per mille of rated]."""
        self._axis.feed_forward(velocity * self._units.velocity, torque)

    def stop(self, ramp: Ramp) -> None:
        """Stop the axis; do nothing at rest."""
        if self.is_at_rest:
            return
        self._forget()
        if ramp is Ramp.CURRENT_LIMIT:
            self._axis.hold()
        else:
            index = 0x6084 if ramp is Ramp.PROFILE else 0x6085
            self._axis.stop(self.acceleration(index, 0x60C6))

    def acceleration(self, index: int, maximum: int) -> float:
        """Return the smaller of an object and its maximum, converted [increments/s^2]."""
        return self._limited(index, maximum) * self._units.acceleration

    @property
    def profile_velocity(self) -> float:
        """Profile velocity 6081h, within 607Fh and motor speed 6080h [rev/min] [increments/s]."""
        motor = max(1, int(self._dictionary.get(0x6080) * self._counts_per_rev / 60))
        return min(self._limited(0x6081, 0x607F) * self._units.velocity, motor)

    def homing_pace(self, subindex: int) -> tuple[float, float]:
        """Return 6099h:`subindex` and 609Ah within the limits [increments/s, increments/s^2]."""
        velocity = min(self._dictionary.get(0x6099, subindex), self._dictionary.get(0x607F))
        return velocity * self._units.velocity, self.acceleration(0x609A, 0x60C5)

    def rebase(self, shift: int) -> None:
        """Shift the shown positions by `shift`."""
        self._axis.rebase(shift)

    def apply_torque_limit(self) -> None:
        """Apply 6072h and 6073h; per mille of rated torque and of rated current are equal."""
        self._axis.set_torque_limit(self._limited(0x6072, 0x6073))

    def apply_following_window(self) -> None:
        """Apply 6065h (FFFFFFFFh = off) and 6066h."""
        window = self._dictionary.get(0x6065)
        off = window == 0xFFFF_FFFF
        timeout = self._dictionary.get(0x6066) / 1000
        self._axis.set_following_window(float("inf") if off else float(window), timeout)

    def apply_own_feed_forward(self) -> None:
        """Apply 2010h, the share of the demand's velocity fed forward by the position loop."""
        self._axis.withhold(1 - self._dictionary.get(0x2010) / 1000)

    def _limited(self, index: int, maximum: int) -> int:
        return min(self._dictionary.get(index), self._dictionary.get(maximum))

    def _forget(self) -> None:
        events = self.events
        if events & _COMPLETION:
            self.events = events & ~_COMPLETION
