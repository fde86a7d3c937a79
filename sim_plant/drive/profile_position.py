"""Profile position mode (CiA 402, mode 1): set-points, their handshake, halt, target reached.

A rising edge of controlword bit 4 applies target, velocity, acceleration and deceleration as
written at that moment; statusword bit 12 acknowledges. With bit 5 (change immediately) the
set-point replaces the present one at once, otherwise it waits in a buffer of one until the present
one is done; bit 12 falls when bit 4 has fallen and the buffer is free. A set-point is ignored while
the buffer is full. Some drives have no buffer and acknowledge until the target is reached
(`Personality.acknowledge_until_reached`). Relative targets (bit 6) count from the preceding target.
Halt (bit 8) interrupts; its release continues the motion to the target.

A target outside 607Dh is clipped to it, which shows as internal limit and warning in the statusword
and as EMCY 8612h until the next set-point.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from sim_plant.canopen.emcy import ErrorCode
from sim_plant.drive.cia402_states import Control, Status
from sim_plant.drive.motion import Motion, Ramp

if TYPE_CHECKING:
    from sim_plant.canopen.emcy import Emergencies
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.drive.lagging_bit import LaggingBit
    from sim_plant.drive.target_window import TargetWindow
    from sim_plant.machine_protocol import Reading

TARGET_MIN, TARGET_MAX = -(2**31), 2**31 - 1


class SetPoint(NamedTuple):
    """Set-point of a rising edge of bit 4 [increments, increments/s, increments/s^2]."""

    target: int
    velocity: float
    acceleration: float
    deceleration: float
    relative: bool


class StatusLags(NamedTuple):
    """Lagging bits of the statusword."""

    reached: LaggingBit
    acknowledge: LaggingBit


class ProfilePosition:
    """State of the mode between enabling and disabling operation."""

    def __init__(
        self,
        dictionary: ObjectDictionary,
        motion: Motion,
        window: TargetWindow,
        emergencies: Emergencies,
        lags: StatusLags,
        *,
        until_reached: bool = False,
    ) -> None:
        self._dictionary = dictionary
        self._motion = motion
        self._emergencies = emergencies
        self._lags = lags
        self._until_reached = until_reached
        self._under_way = False
        self.window = window
        self._target = 0
        self._anchored = True
        self._controlword = 0
        self._active: SetPoint | None = None
        self._buffered: SetPoint | None = None
        self._acknowledged = False
        self._halted = False
        self._clipped = False

    def show(self) -> int:
        """Return the mode's bits of the statusword."""
        reached, acknowledge = self._lags
        reached.set(self._motion.is_at_rest if self._halted else self.window.reached)
        acknowledge.set(self._acknowledged or self._held)
        return (
            (Status.TARGET_REACHED if reached.shown else 0)
            | (Status.SET_POINT_ACKNOWLEDGE if acknowledge.shown else 0)
            | (Status.INTERNAL_LIMIT | Status.WARNING if self._clipped else 0)
        )

    @property
    def _held(self) -> bool:
        """True if the acknowledge bit is held for the current set-point."""
        if self._halted or self.window.reached:
            self._under_way = False
        return self._until_reached and self._under_way

    def start(self, demand: int, controlword: int) -> None:
        """Start without a set-point: the axis rests at `demand`, or comes to rest near it.

        Bit 4 must rise anew.
        """
        self.abandon()
        self._target, self._anchored = demand, False
        self._controlword = controlword
        self._halted = bool(controlword & Control.HALT)
        self.window.attend()

    def abandon(self) -> None:
        """Forget all set-points."""
        self._active = self._buffered = None
        self._acknowledged = self._halted = self._clipped = self._under_way = False
        for bit in self._lags:
            bit.clear()
        self._emergencies.clear(ErrorCode.POSITION_LIMIT)
        self.window.close()

    def control(self, controlword: int) -> None:
        """Process a new controlword while operation is enabled."""
        risen = controlword & ~self._controlword
        fallen = self._controlword & ~controlword
        self._controlword = controlword
        if risen & Control.HALT:
            self._halt()
        if fallen & Control.HALT:
            self._halted = False
        begun = bool(risen & Control.NEW_SET_POINT) and self._accept(controlword)
        if fallen & Control.HALT and not begun:
            self._go_on()
        self._lower_acknowledge()

    def observe(self, reading: Reading) -> None:
        """Process latched readings."""
        if not self._anchored and self._motion.is_at_rest:
            self._anchored = True
            self._target = reading.demand
            if not self._halted:
                self.window.open(self._target)
        self.window.observe(reading.position)

    def progress(self) -> None:
        """Process a change of axis events."""
        if self._active is None or self._halted or not self._motion.done:
            return
        if self._buffered is not None:
            following, self._buffered = self._buffered, None
            self._begin(following)
            self._lower_acknowledge()
        else:
            self._active = None
            self.window.open(self._target)

    def _accept(self, controlword: int) -> bool:
        """Accept a set-point; return True if the motion starts at once."""
        if self._held:
            return False
        set_point = self._set_point(bool(controlword & Control.RELATIVE))
        if controlword & Control.CHANGE_IMMEDIATELY or self._active is None:
            self._buffered = None
            self._acknowledged = True
            self._begin(set_point)
            return True
        if self._buffered is None:
            self._buffered = set_point
            self._acknowledged = True
        return False

    def _set_point(self, relative: bool) -> SetPoint:
        return SetPoint(
            target=self._dictionary.get(0x607A),
            velocity=self._motion.profile_velocity,
            acceleration=self._motion.acceleration(0x6083, 0x60C5),
            deceleration=self._motion.acceleration(0x6084, 0x60C6),
            relative=relative,
        )

    def _begin(self, set_point: SetPoint) -> None:
        wanted = set_point.target + (self._target if set_point.relative else 0)
        low, high = self._range()
        clipped = min(max(wanted, low), high)
        self._clipped = clipped != wanted
        turns = self._motion.turns
        absolute = turns.size and not set_point.relative
        self._target = turns.same_turn(clipped, self._motion.demand) if absolute else clipped
        if self._clipped:
            self._emergencies.raise_error(ErrorCode.POSITION_LIMIT)
        else:
            self._emergencies.clear(ErrorCode.POSITION_LIMIT)
        self._active = set_point
        self._anchored = self._under_way = True
        self.window.close()
        if not self._halted:
            self._move()

    def _range(self) -> tuple[int, int]:
        low, high = self._dictionary.get(0x607D, 1), self._dictionary.get(0x607D, 2)
        return (low, high) if low < high else (TARGET_MIN, TARGET_MAX)

    def _move(self) -> None:
        assert self._active is not None  # noqa: S101 - by both callers
        self._motion.move(self._target, *self._active[1:4])

    def _halt(self) -> None:
        self._halted = True
        self.window.close()
        self._motion.stop(Ramp(self._dictionary.get(0x605D)))

    def _go_on(self) -> None:
        if self._active is not None:
            self._move()
        else:
            self.window.open(self._target)

    def _lower_acknowledge(self) -> None:
        if not self._controlword & Control.NEW_SET_POINT and self._buffered is None:
            self._acknowledged = False
