"""Fixtures that several test modules share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from drivers.drive_bus import AxisInfo, LimitExceeded, Sample
from hil.measurement import Coupling, Gravity, Inertia, Partner
from hil.plan import Plan, PlannedRobot
from hil.profile import Trapezoid
from hil.robot import load_robot

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.drive_bus import Move
    from hil.robot import Robot


class _Path:
    """A trapezoid on the grid of samples."""

    def __init__(self, begin: int, profile: Trapezoid, period: float) -> None:
        times = np.arange(0.0, profile.duration + period, period)
        self._points = list(zip(profile.q(times).tolist(), profile.qd(times).tolist(), strict=True))
        self._begin = begin
        self.rests = begin + len(times) + 5

    def at(self, sample: int) -> tuple[float, float]:
        return self._points[min(max(sample - self._begin, 0), len(self._points) - 1)]


class IdealBus:
    """A DriveBus whose axes follow their trapezoids exactly, and that notes what it is told.

    Torque is 10 N m of friction along the motion and 3 N m of load. `tamper` may change each sample
    before it is handed out, or raise; `deaf` axes take set-points and stay where they are.
    """

    LATENCY = 3

    def __init__(self, robot: Robot, period: float = 0.004) -> None:
        self.period = period
        self.robot = robot
        self.time = 0.0
        self.n_samples = 0
        self.log: list[str] = []
        self.moves: list[tuple[float, int, Move]] = []
        self.tamper: Callable[[Sample], Sample] = lambda sample: sample
        self.deaf: set[int] = set()
        self._paths = [_Path(0, Trapezoid(0.0, 0.0, 1.0, 1.0), period)] * robot.n_joints

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        return tuple(
            AxisInfo(f"axis {i + 1}", "ideal", -9.0, 9.0, 9.0, 99.0, 0.01, 1e-5)
            for i in range(self.robot.n_joints)
        )

    def __enter__(self) -> IdealBus:
        self.log.append("powered on")
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.log.append("powered off")

    def move(self, moves: Mapping[int, Move]) -> None:
        for index, move in moves.items():
            if not self.robot.q_min[index] <= move.target <= self.robot.q_max[index]:
                raise LimitExceeded(f"axis {index + 1}: target {move.target}")
        for index, move in moves.items():
            self.moves.append((self.time, index, move))
            here = self._paths[index].at(self.n_samples)[0]
            target = here if index in self.deaf else move.target
            profile = Trapezoid(here, target, move.velocity, move.acceleration)
            self._paths[index] = _Path(self.n_samples + self.LATENCY, profile, self.period)

    def sample(self) -> Sample:
        self.n_samples += 1
        self.time = self.n_samples * self.period
        q, velocity = zip(*(path.at(self.n_samples) for path in self._paths), strict=True)
        sample = Sample(
            time=self.time,
            q=q,
            tau=tuple(3.0 + 10.0 * (v > 0) - 10.0 * (v < 0) for v in velocity),
            flags=(0,) * len(self._paths),
            reached=not self.deaf and all(self.n_samples >= path.rests for path in self._paths),
        )
        return self.tamper(sample)

    def halt(self) -> None:
        self.log.append("halted")


@pytest.fixture(scope="session")
def manutec() -> Robot:
    return load_robot("manutec-r15")


@pytest.fixture
def ideal_bus(manutec: Robot) -> IdealBus:
    return IdealBus(manutec)


@pytest.fixture
def small_plan(manutec: Robot) -> Plan:
    """One measurement of each kind; about 20 s."""
    return Plan(
        robot=PlannedRobot(name=manutec.name, digest=manutec.digest),
        measurements=(
            Gravity(
                id="g1",
                axis=2,
                q=(0.0, -0.3, 0.2, 0.0, 0.5, 0.0),
                stroke=0.4,
                velocity=0.4,
                acceleration=8.0,
                cycles=2,
            ),
            Inertia(
                id="i1",
                axis=3,
                q=(0.1, -0.2, 0.3, 0.0, 0.5, 0.0),
                stroke=0.6,
                velocity=1.5,
                acceleration=10.0,
            ),
            Coupling(
                id="c1",
                axis=1,
                q=(0.1, -0.2, 0.3, 0.0, 0.5, 0.0),
                stroke=0.15,
                velocity=0.05,
                acceleration=5.0,
                partner=Partner(axis=2, stroke=0.1, velocity=0.5, acceleration=5.0),
            ),
        ),
    )
