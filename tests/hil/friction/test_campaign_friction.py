"""Friction over a campaign: a law from the residual of base parameters, and its drift."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

from hil.estimation.campaign_friction import campaign_friction
from hil.estimation.condensed import stack
from hil.estimation.two_step_methods import prepare
from hil.friction.law import friction_torque, friction_variance
from hil.planning.design.by_counts import design
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.condensed import Stacked
    from hil.friction.law import FrictionLaw
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

COUNTS = {"gravity": 12, "inertia": 24, "coupling": 3}


def found(robot: Robot, *levels: Friction, noise: float = 0.0) -> FrictionLaw:
    """Return the friction law of a whole campaign with known base parameters."""
    return campaign_friction(robot, TABLE_3_A, stacks(robot, *levels, noise=noise))


def stacks(robot: Robot, *levels: Friction, noise: float = 0.0) -> list[list[Stacked]]:
    """Return a campaign in which the friction level of each axis changes in turn."""
    rng, recorded, turns = np.random.default_rng(4), [], Counter[int]()
    for measurement in design(robot, COUNTS).measurements:
        level = levels[turns[measurement.index] % len(levels)]  # so that each axis has all levels
        turns[measurement.index] += 1
        each = record(robot, measurement, TABLE_3_A, level, noise=noise, rng=rng)
        recorded.append((measurement, each))
    prepared, _ = prepare(recorded)
    return [axes for motion, s in prepared for axes in stack(robot, motion, s)]


def scaled(share: float) -> Friction:
    plain = Friction()
    return Friction(share * plain.coulomb, share * plain.viscous, share * plain.root)


def evaluate_law(robot: Robot, law: FrictionLaw) -> tuple[Array, Array, Array]:
    """Return velocities of the law's data, its torques there and their variances."""
    shares = np.linspace(-1.0, 1.0, 40)[:, np.newaxis]
    slowest, fastest = np.array([axis.speeds for axis in law.axes if axis and axis.speeds]).T
    qd = np.sign(shares) * (slowest + np.abs(shares) * (fastest - slowest))
    still = np.zeros_like(qd)
    tau = friction_torque(robot, law, still, qd, still)
    return qd, tau, friction_variance(robot, law, still, qd, still)


def test_a_law_of_the_family_is_found_as_it_is(manutec: Robot) -> None:
    friction = Friction(offset=np.array([1, -2, 0.5, 0.3, -0.2, 0.1]))
    qd, tau, _ = evaluate_law(manutec, found(manutec, friction))
    wanted = friction.torque(qd, np.zeros(len(qd)))
    assert np.abs(tau - wanted).max() < 0.02 * np.abs(wanted).max()


def test_beyond_the_speeds_it_was_found_from_it_goes_on_as_the_plainest_law(
    manutec: Robot,
) -> None:
    law = found(manutec, Friction())
    slowest, fastest = np.array([axis.speeds for axis in law.axes if axis and axis.speeds]).T
    slope = np.array([axis.slope for axis in law.axes if axis])

    def torque(qd: Array) -> Array:
        return friction_torque(manutec, law, 0 * qd, qd, 0 * qd)

    assert torque(-3 * fastest) == pytest.approx(torque(-fastest) - 2 * slope * fastest)
    assert torque(slowest / 2) == pytest.approx(torque(slowest) - slope * slowest / 2)
    assert torque(0 * fastest) == pytest.approx(0.0, abs=5e-3)


def test_without_drift_the_level_wanders_by_hardly_anything(manutec: Robot) -> None:
    law = found(manutec, Friction(), noise=0.001)
    assert all(axis is not None and axis.wander < 0.01 for axis in law.axes)


def test_a_level_that_changes_is_met_in_its_mean_and_intervals_hold_all_of_it(
    manutec: Robot,
) -> None:
    shares = 0.94, 1.0, 1.06
    law = found(manutec, *map(scaled, shares), noise=0.001)
    wander = np.array([axis.wander for axis in law.axes if axis])
    assert ((wander > 0.03) & (wander < 0.13)).all()
    qd, tau, variance = evaluate_law(manutec, law)
    fast = np.abs(qd) > 0.1 * np.abs(qd).max(axis=0)
    for share in shares:
        wanted = scaled(share).torque(qd, np.zeros(len(qd)))
        inside = np.abs(wanted - tau) < 2 * np.sqrt(variance)
        assert inside[fast].mean() > 0.95


def test_an_axis_that_too_few_measurements_move_has_no_law(manutec: Robot) -> None:
    every = stacks(manutec, Friction())
    without = [[each for each in axes if each.axis != 5] for axes in every]
    of_last = [axes for axes in every if any(each.axis == 5 for each in axes)]
    law = campaign_friction(manutec, TABLE_3_A, [*without, *of_last[: FOR_A_LAW - 1]])
    assert law.unknown == (6,)
