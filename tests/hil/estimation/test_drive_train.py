"""Effects between current and arm are identified: elastic
gears, delays, load-dependent friction.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.drive_train import directly_driven, find_drive_train
from hil.estimation.identify import estimate
from hil.estimation.signals import derivatives, signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque
from hil.planning.design.by_counts import design

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Prepared = list[tuple[Measurement, Signals]]

MU = np.array([0.05, 0.05, 0.08, 0.0, 0.0, 0.0])
COMPLIANCE = 1e-6 * np.array([0.0, 0.5, 1.2, 0.0, 0.0, 0.0])
"""Compliance of the gears [rad/(N m)]."""


@pytest.fixture(scope="module")
def recorded(manutec: Robot) -> list[tuple[Measurement, Recording]]:
    plan = design(manutec, {"gravity": 24, "inertia": 36, "coupling": 3})
    return recordings(manutec, plan.measurements)


def recordings(
    robot: Robot, measurements: Sequence[Measurement]
) -> list[tuple[Measurement, Recording]]:
    rng = np.random.default_rng(3)
    return [
        (m, record(robot, m, TABLE_3_A, Friction(), noise=0.0005, rng=rng)) for m in measurements
    ]


@pytest.fixture(scope="module")
def prepared(recorded: Sequence[tuple[Measurement, Recording]]) -> Prepared:
    return [(m, signals(recording)) for m, recording in recorded]


def softened(robot: Robot, s: Signals) -> Signals:
    """Return encoder and current signals if `s` is the motion of the links."""
    twist = COMPLIANCE * inverse_dynamics(robot, TABLE_3_A, s.q, s.qd, s.qdd)
    qd, qdd = derivatives(twist, s.period)
    tau = s.tau + motor_torque(robot, s.q, qd, qdd)
    return replace(s, q=s.q + twist, qd=s.qd + qd, qdd=s.qdd + qdd, tau=tau)


def loaded(robot: Robot, recording: Recording) -> Recording:
    """Return the same signals with friction proportional to the transmitted load."""
    s = signals(recording)
    load = np.abs(inverse_dynamics(robot, TABLE_3_A, s.q, s.qd, s.qdd))
    return replace(recording, tau=recording.tau + MU * load * np.sign(np.round(s.qd, 6)))


@pytest.fixture(scope="module")
def soft(manutec: Robot, prepared: Prepared) -> Prepared:
    return [(m, softened(manutec, s)) for m, s in prepared]


class TestSoftGears:
    def test_they_are_found_with_their_compliance(self, manutec: Robot, soft: Prepared) -> None:
        found = find_drive_train(manutec, soft)
        assert found.soft.tolist() == (COMPLIANCE > 0).tolist()
        own = found.soft
        assert found.compliance[own] == pytest.approx(COMPLIANCE[own], rel=0.02)
        assert (np.abs(found.compliance - COMPLIANCE)[own] < found.compliance_error[own]).all()

    def test_no_rigid_gear_is_taken_for_soft(self, manutec: Robot, prepared: Prepared) -> None:
        assert not find_drive_train(manutec, prepared).soft.any()

    def test_links_are_where_they_let_them_be(
        self, manutec: Robot, prepared: Prepared, soft: Prepared
    ) -> None:
        """Only moving axes are compared, since friction at rest may balance any torque."""
        train = replace(
            directly_driven(manutec), p=TABLE_3_A, compliance=COMPLIANCE, soft=COMPLIANCE > 0
        )
        index = next(k for k, (m, _) in enumerate(soft) if m.kind == "inertia" and m.index == 2)
        links, motors = prepared[index][1], soft[index][1]
        moves = motors.moving(manutec, 2)
        found = motors.smoothed(train.applied(manutec, motors).link[0] - links.q)[moves, 2]
        neglected = motors.smoothed(motors.q - links.q)[moves, 2]
        assert np.abs(found).max() < 0.1 * np.abs(neglected).max()

    def test_parameters_come_out_as_with_rigid_ones(self, manutec: Robot, soft: Prepared) -> None:
        train = find_drive_train(manutec, soft)
        taken = SimultaneousFit(manutec, [(m, train.applied(manutec, s)) for m, s in soft])
        neglected = SimultaneousFit(manutec, soft)
        error, without = (np.abs(fit.solve() - TABLE_3_A) for fit in (taken, neglected))
        assert np.linalg.norm(error) < 0.02 * np.linalg.norm(without)


@pytest.fixture(scope="module")
def found(manutec: Robot, recorded: Sequence[tuple[Measurement, Recording]]) -> Estimate:
    """Return the estimate with load-dependent friction."""
    return estimate(manutec, [(m, loaded(manutec, r)) for m, r in recorded])


class TestLoadFriction:
    def test_its_share_is_a_result(self, found: Estimate) -> None:
        mu, error = found.load_friction
        assert mu[:3] == pytest.approx(MU[:3], abs=2e-3)
        assert (np.abs(mu - MU) < 4 * error).all()

    def test_parameters_hold_no_part_of_it(
        self,
        manutec: Robot,
        recorded: Sequence[tuple[Measurement, Recording]],
        found: Estimate,
    ) -> None:
        without = estimate(manutec, recorded)
        plain, other = (np.abs(each.values - TABLE_3_A) for each in (without, found))
        assert np.linalg.norm(other) < 2 * np.linalg.norm(plain)

    def test_it_makes_no_current_late(self, found: Estimate) -> None:
        """Load-dependent friction has a corner where an axis changes from driving to braking."""
        assert np.abs(found.drive_train.lag[MU > 0]).max() < 4e-5

    def test_axes_without_it_have_no_columns_for_it(
        self, manutec: Robot, prepared: Prepared
    ) -> None:
        fit = SimultaneousFit(manutec, prepared)
        mu, error = fit.load_friction
        assert fit.loaded.tolist() == (mu > 2 * error).tolist()
        assert fit.loaded.sum() <= 1
