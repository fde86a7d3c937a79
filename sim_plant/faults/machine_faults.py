"""Machine with faulty sensors, brakes or motors.

Readings of a faulty sensor are changed on their way from the machine to the firmware. An encoder
jump is more: the control loop sees the jump too and drives the axis to where the encoder shows the
demand, so the demand is shifted against the true angle.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.machine_protocol import Reading
from sim_plant.physics import friction
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from sim_plant.drive_settings import DriveSettings
    from sim_plant.machine_protocol import Axis
    from sim_plant.plant import Plant

_WIDTH = len(Reading._fields)
_POSITION, _DEMAND = Reading._fields.index("position"), Reading._fields.index("demand")
POSITIONS = (_POSITION,)
CURRENTS = (Reading._fields.index("torque"), Reading._fields.index("current"))


class FaultyAxis:
    """Servo with an encoder that may have jumped (see `sim_plant.machine_protocol.Axis`)."""

    def __init__(self, axis: Axis) -> None:
        self._axis = axis
        self._limit = 0
        self.jump = 0
        """Jump of the encoder [increments]."""
        self.strength: int | None = None
        """Remaining torque [per mille of rated]; None for full torque."""

    def enable(self) -> None:
        """Energise the axis."""
        self._axis.enable()

    def disable(self) -> None:
        """Remove the torque."""
        self._axis.disable()

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        """Start a move to `target`, as shown by the encoder."""
        self._axis.move(target - self.jump, velocity, acceleration, deceleration)

    def follow(self, target: float, period: float) -> None:
        """Lead the demand to `target`, as shown by the encoder."""
        self._axis.follow(target - self.jump, period)

    def feed_forward(self, velocity: float, torque: float) -> None:
        """Add to the commands of velocity and torque."""
        self._axis.feed_forward(velocity, torque)

    def withhold(self, share: float) -> None:
        """Reduce the feed-forward of the demand's velocity."""
        self._axis.withhold(share)

    def stop(self, deceleration: float) -> None:
        """Bring the axis to rest."""
        self._axis.stop(deceleration)

    def hold(self) -> None:
        """Freeze the demand."""
        self._axis.hold()

    def set_torque_limit(self, per_mille: int) -> None:
        """Limit the torque command, at most to the remaining torque."""
        self._limit = per_mille
        self._axis.set_torque_limit(min(per_mille, self._strength))

    def weaken(self, strength: int | None) -> None:
        """Limit the torque to `strength`."""
        self.strength = strength
        self._axis.set_torque_limit(min(self._limit, self._strength))

    def set_following_window(self, window: float, timeout: float) -> None:
        """Set the following error window."""
        self._axis.set_following_window(window, timeout)

    def rebase(self, shift: int) -> None:
        """Shift the shown positions."""
        self._axis.rebase(shift)

    @property
    def _strength(self) -> int:
        return self._limit if self.strength is None else self.strength


class FaultyMachine:
    """Plant with faults between sensors and drives; implements `Machine`.

    Attributes
    ----------
    offsets, clips, frozen : dict
        Offset of the current sensor, its range, and its frozen values, by axis from 0.
    plant : Plant
        The machine as it truly is.
    """

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.axes = tuple(FaultyAxis(axis) for axis in plant.axes)
        self.offsets: dict[int, int] = {}
        self.clips: dict[int, int] = {}
        self.frozen: dict[int, tuple[int, int]] = {}
        self._renewed: dict[int, list[float]] = {}
        self._shown = plant.read().copy()

    @property
    def time(self) -> float:
        """Time of the machine [s]."""
        return self.plant.time

    @property
    def drives(self) -> Sequence[DriveSettings]:
        """Settings of the drives, in joint order."""
        return self.plant.drives

    @property
    def handle_event(self) -> Callable[[int, int], None]:
        """Handler of changed events, called with axis index and events."""
        return self.plant.handle_event

    @handle_event.setter
    def handle_event(self, handler: Callable[[int, int], None]) -> None:
        self.plant.handle_event = handler

    def advance(self, duration: float) -> None:
        """Run the physics for `duration` [s]."""
        self.plant.advance(duration)

    def advance_quietly(
        self, durations: Sequence[float], watch: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return no readings, since every latch may show a fault (see `Machine`)."""
        del durations, watch
        return np.empty((0, len(self._shown)), dtype=np.int64)

    def read(self) -> NDArray[np.int64]:
        """Latch encoders and current sensors, with their faults."""
        before = self._shown.copy()
        self._shown[:] = self.plant.read()
        for i, axis in enumerate(self.axes):
            self._shown[i * _WIDTH + _POSITION] += axis.jump
            self._shown[i * _WIDTH + _DEMAND] += axis.jump
        for place in CURRENTS:
            for i, offset in self.offsets.items():
                self._shown[i * _WIDTH + place] += offset
            for i, clip in self.clips.items():
                shown = self._shown[i * _WIDTH + place]
                self._shown[i * _WIDTH + place] = min(max(shown, -clip), clip)
        for i, values in self.frozen.items():
            for place, value in zip(CURRENTS, values, strict=True):
                self._shown[i * _WIDTH + place] = value
        for place, renewed in self._renewed.items():
            number = math.floor(self.time / renewed[0] + 1e-6)  # a sum of periods may fall short
            if number == renewed[1]:
                self._shown[place] = before[place]
            renewed[1] = number
        return self._shown

    def renew(self, axis: int, places: Sequence[int], period: float | None) -> None:
        """Set the refresh period of some values of an axis [s]; None refreshes at every latch."""
        for place in places:
            self._renewed.pop(axis * _WIDTH + place, None)
            if period is not None:
                self._renewed[axis * _WIDTH + place] = [period, -1.0]

    def freeze_current(self, axis: int) -> None:
        """Freeze the current reading of an axis at its present value."""
        values = [int(self._shown[axis * _WIDTH + place]) for place in CURRENTS]
        self.frozen[axis] = (values[0], values[1])

    def jump(self, axis: int, increments: int) -> None:
        """Let an encoder jump; the control loop sees a following error."""
        self.axes[axis].jump += increments
        angle = increments / self.plant.const[axis, st.COUNTS_PER_RAD]
        self.plant.profile[axis, [st.P0, st.TARGET, st.DEMAND]] -= angle

    def push(self, axis: int, torque: float) -> None:
        """Apply an external torque to an axis [N m or N]; 0 removes it."""
        self.plant.state[axis, st.PUSH] = torque

    def press_brake(self, axis: int, times: int) -> None:
        """Add `times` the brake's friction to an axis; -1 opens a closed brake."""
        const = self.plant.const
        const[axis, st.F_COULOMB] += times * const[axis, st.BRAKE]
        friction.refresh(const, self.plant.state, axis)
