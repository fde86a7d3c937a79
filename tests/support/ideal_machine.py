"""Plant of ideal axes: each follows its trapezoid exactly and records its drive's calls."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sim_plant.drive_settings import DriveSettings
from sim_plant.machine_protocol import AxisEvent, Reading

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray


class IdealAxis:
    """Axis that follows its trapezoid exactly; tests may displace it or raise its events."""

    def __init__(self) -> None:
        self.enabled = False
        self.demand = 0.0
        self.velocity = 0.0
        self.offset = 0
        """Measured position minus demand [increments]."""
        self.forced = AxisEvent(0)
        """Events raised by a test."""
        self.calls: list[tuple[object, ...]] = []
        self._goal: tuple[float, float, float, float] | None = None
        self._stopping = 0.0

    def enable(self) -> None:
        self.enabled = True
        self.calls.append(("enable",))

    def disable(self) -> None:
        self.enabled = False
        self._goal, self.velocity, self._stopping = None, 0.0, 0.0
        self.calls.append(("disable",))

    def move(
        self, target: float, velocity: float, acceleration: float, deceleration: float
    ) -> None:
        self._goal, self._stopping = (target, velocity, acceleration, deceleration), 0.0
        self.calls.append(("move", target, velocity, acceleration, deceleration))

    def follow(self, target: float, period: float) -> None:
        self.demand, self.velocity = target, 0.0
        self.calls.append(("follow", target, period))

    def feed_forward(self, velocity: float, torque: float) -> None:
        self.calls.append(("feed forward", velocity, torque))

    def withhold(self, share: float) -> None:
        self.calls.append(("withhold", share))

    def stop(self, deceleration: float) -> None:
        self._goal, self._stopping = None, deceleration
        self.calls.append(("stop", deceleration))

    def hold(self) -> None:
        self._goal, self.velocity, self._stopping = None, 0.0, 0.0
        self.calls.append(("hold",))

    def set_torque_limit(self, per_mille: int) -> None:
        self.calls.append(("torque", per_mille))

    def set_following_window(self, window: float, timeout: float) -> None:
        self.calls.append(("window", window, timeout))

    def rebase(self, shift: int) -> None:
        self.demand += shift

    @property
    def events(self) -> int:
        done = AxisEvent.DONE if self._goal is None and not self._stopping else AxisEvent(0)
        still = AxisEvent.STANDSTILL if self.velocity == 0.0 else AxisEvent(0)
        return int(done | still | self.forced)

    def step(self, dt: float) -> None:
        if self._stopping:
            change = min(abs(self.velocity), self._stopping * dt)
            self.velocity -= math.copysign(change, self.velocity)
            self._stopping = self._stopping if self.velocity else 0.0
        elif self._goal is not None:
            target, velocity, acceleration, deceleration = self._goal
            rest = target - self.demand
            wanted = math.copysign(min(velocity, math.sqrt(2 * deceleration * abs(rest))), rest)
            step = max(acceleration, deceleration) * dt
            self.velocity += min(max(wanted - self.velocity, -step), step)
            if abs(rest) <= abs(self.velocity) * dt + deceleration * dt**2:
                self.demand, self.velocity, self._goal = target, 0.0, None
        self.demand += self.velocity * dt

    def reading(self) -> Reading:
        demand = round(self.demand)
        position, velocity = demand + self.offset, round(self.velocity)
        return Reading(position, velocity, 11, -22, demand, -self.offset, self.events)


class IdealMachine:
    """A `Machine` of ideal axes in steps of a millisecond, with their drives."""

    STEP = 0.001

    def __init__(self, n_axes: int = 6) -> None:
        self.time = 0.0
        self.axes = tuple(IdealAxis() for _ in range(n_axes))
        self.handle_event: Callable[[int, int], None] = lambda _axis, _events: None
        self._events = [axis.events for axis in self.axes]
        self.drives = tuple(
            DriveSettings(
                name=f"axis {i + 1}",
                node_id=i + 1,
                vendor_id=0x1234,
                product_code=0x402,
                revision=7,
                serial=100 + i,
                rated_current=5000,
                rated_torque=3000,
                max_torque=3000,
                increments_per_revolution=4096,
                gear=(100, 1),
                software_limits=(-1_000_000, 1_000_000),
                max_motor_speed=6000,
                max_acceleration=5_000_000,
            )
            for i in range(n_axes)
        )

    def advance(self, duration: float) -> None:
        self.time += duration
        steps = round(duration / self.STEP)
        for _ in range(steps):
            for number, axis in enumerate(self.axes):
                axis.step(self.STEP)
                events = axis.events
                if events != self._events[number]:
                    self._events[number] = events
                    self.handle_event(number, events)

    def advance_quietly(
        self, durations: Sequence[float], watch: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        del durations, watch
        return np.empty((0, 0), dtype=np.int64)

    def read(self) -> NDArray[np.int64]:
        return np.array([axis.reading() for axis in self.axes], dtype=np.int64).ravel()
