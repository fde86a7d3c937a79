"""Servo axis of the plant as commanded by its drive's firmware.

Firmware counts in increments of the motor shaft and per mille of rated torque; the arrays of the
compiled step hold joint angles and torques. This module converts between the two.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim_plant.machine_protocol import AxisEvent
from sim_plant.physics import profile_generator
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class ServoAxis:
    """Axis as seen by its firmware (see `sim_plant.machine_protocol.Axis`).

    Parameters
    ----------
    index : int
        Index of the axis in the machine.
    const, state, profile : ndarray, shape (n, ...)
        See `sim_plant.physics.state`; this axis writes into its own rows.
    events : list of int
        `AxisEvent` bits of all axes, as last reported; motion clears DONE of this one.
    clock : callable
        Time of the machine [s].
    """

    def __init__(
        self,
        index: int,
        const: Array,
        state: Array,
        profile: Array,
        events: list[int],
        clock: Callable[[], float],
    ) -> None:
        self._index, self._events, self._clock = index, events, clock
        self._const, self._state, self._profile = const[index], state[index], profile[index]
        self._scale, self._zero = self._const[st.COUNTS_PER_RAD], self._const[st.ZERO]

    def enable(self) -> None:
        """Energise, release the brake and hold the present position."""
        self._state[st.INTEGRAL] = self._state[st.OUTSIDE] = 0.0
        self.hold()
        self._state[st.ENABLED] = 1.0

    def disable(self) -> None:
        """Remove the torque and close the brake."""
        self._state[st.ENABLED] = 0.0
        self.hold()

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        """Start a trapezoid from the present demand to `target` [inc, inc/s, inc/s^2]."""
        scale = abs(self._scale)
        goal = (target - self._zero) / self._scale
        segments = profile_generator.trapezoid(
            self._profile[st.DEMAND],
            self._profile[st.DEMAND_V],
            goal,
            velocity / scale,
            acceleration / scale,
            deceleration / scale,
        )
        profile_generator.load(self._profile, self._clock(), segments, goal)
        self._moving()

    def follow(self, target: float, period: float) -> None:
        """Lead the demand towards `target` [inc] over `period` [s]."""
        goal = (target - self._zero) / self._scale
        profile_generator.follow(self._profile, self._clock(), goal, period)
        self._moving()

    def stop(self, deceleration: float) -> None:
        """Bring the demand to rest [inc/s^2] and hold."""
        v = float(self._profile[st.DEMAND_V])
        rate = deceleration / abs(self._scale)
        segments = [(abs(v) / rate, math.copysign(rate, -v))]
        profile_generator.load(self._profile, self._clock(), segments, None)
        self._moving()

    def feed_forward(self, velocity: float, torque: float) -> None:
        """Add to the commands of velocity [inc/s] and of torque [per mille of rated]."""
        self._profile[st.VELOCITY_OFFSET] = velocity / self._scale
        self._profile[st.TORQUE_OFFSET] = torque * self._const[st.TORQUE_PER_MILLE]

    def withhold(self, share: float) -> None:
        """Reduce the feed-forward of the demand's velocity by a share from 0 to 1."""
        self._profile[st.WITHHELD] = share

    def hold(self) -> None:
        """Freeze the demand at the present measured position."""
        self._profile[st.DEMAND], self._profile[st.DEMAND_V] = self._state[st.Q], 0.0
        profile_generator.load(self._profile, self._clock(), [], None)

    def set_torque_limit(self, per_mille: int) -> None:
        """Limit the torque command [per mille of rated torque]."""
        self._state[st.TORQUE_LIMIT] = per_mille * abs(self._const[st.TORQUE_PER_MILLE])

    def set_following_window(self, window: float, timeout: float) -> None:
        """Set the following error window [inc, inf = off] and its maximum duration [s]."""
        self._state[st.WINDOW] = window / abs(self._scale)
        self._state[st.WINDOW_TIME] = timeout

    def rebase(self, shift: int) -> None:
        """Shift the shown positions by `shift` [increments]."""
        self._const[st.ZERO] += shift
        self._zero = self._const[st.ZERO]

    def recount(self, factor: float) -> None:
        """Change the unit of positions, to `factor` new units per old unit."""
        self._const[st.COUNTS_PER_RAD] *= factor
        self._const[st.ZERO] = round(self._const[st.ZERO] * factor)
        self._scale, self._zero = self._const[st.COUNTS_PER_RAD], self._const[st.ZERO]

    def _moving(self) -> None:
        self._events[self._index] &= ~int(AxisEvent.DONE)
        self._state[st.EVENTS] = self._events[self._index]
