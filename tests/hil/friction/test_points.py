"""Friction at one speed, from synthetic measurements at constant velocity."""

import numpy as np
import pytest
from synthetic import TABLE_3_A, Friction, record

import hil
from hil.estimation.friction.points import GravityModel, judge_points, points
from hil.planning.design.friction import sweep

OFFSET = np.array([1.0, -2.0, 0.5, 0.3, -0.2, 0.1])
MODEL = GravityModel(TABLE_3_A, 1e-6 * np.eye(14))


@pytest.fixture(scope="module")
def robot():
    return hil.Robot.load("manutec-r15")


def measured(robot, axis, friction, noise=0.0):
    rng, begin, found = np.random.default_rng(3), 0.0, []
    for m in sweep(robot, [axis], speeds=6, slowest=0.02).measurements:
        recording = record(robot, m, TABLE_3_A, friction, begin=begin, noise=noise, rng=rng)
        found.append((m, recording))
        begin = float(recording.time[-1]) + 1.0
    return found


def level(friction, v):
    return friction.coulomb + friction.viscous * v + friction.root * np.cbrt(v)


@pytest.mark.parametrize("axis", [0, 1, 4])
@pytest.mark.parametrize("model", [None, MODEL], ids=["half-differences", "model"])
def test_friction_is_found_with_and_without_a_model_of_gravity(robot, axis, model):
    friction = Friction(offset=OFFSET)
    found, left_out = points(robot, measured(robot, axis, friction), model)
    assert not left_out
    assert len(found) == 6
    for point in found:
        assert point.friction == pytest.approx(level(friction, point.velocity), rel=1e-3)


def test_with_a_model_both_directions_stand_apart(robot):
    found, _ = points(robot, measured(robot, 1, Friction(offset=OFFSET)), MODEL)
    for point in found:
        assert point.absolute
        assert point.forward + point.backward == pytest.approx(2 * OFFSET[1], abs=0.05)


def test_without_a_model_asymmetry_shows_only_where_gravity_cannot_act(robot):
    friction = Friction(offset=OFFSET)
    free, _ = points(robot, measured(robot, 0, friction))
    loaded, _ = points(robot, measured(robot, 1, friction))
    assert all(point.absolute for point in free)
    assert not any(point.absolute for point in loaded)
    assert list(judge_points([*free, *loaded])) == [0]


def test_the_model_s_own_uncertainty_widens_the_asymmetry(robot):
    recorded = measured(robot, 1, Friction(offset=OFFSET), noise=1e-3)
    sure, _ = points(robot, recorded, MODEL)
    unsure, _ = points(robot, recorded, GravityModel(TABLE_3_A, 0.01 * np.eye(14)))
    assert judge_points(unsure)[1].standard_error > 3 * judge_points(sure)[1].standard_error


def test_standard_errors_within_a_measurement_cover_what_noise_does(robot):
    friction = Friction(coulomb=40.0, viscous=0.0, root=0.0, offset=OFFSET)
    found, _ = points(
        robot, [m for axis in (0, 3, 4) for m in measured(robot, axis, friction, 0.002)]
    )
    misses = [(p.friction - 40.0) / p.friction_error for p in found]
    misses += [(p.common - OFFSET[p.axis]) / p.common_error for p in found if p.absolute]
    assert 0.6 < np.sqrt(np.mean(np.square(misses))) < 1.5


def test_drift_within_a_measurement_does_not_look_like_friction_or_asymmetry(robot):
    drifting = Friction(coulomb=40.0, viscous=0.0, root=0.0, growth=1e-3)
    found, _ = points(robot, measured(robot, 0, drifting))
    for point in found:
        assert point.friction == pytest.approx(40.0 * (1 + 1e-3 * point.time), rel=1e-4)
        assert abs(point.common) < 1e-2


def test_a_recording_without_constant_velocity_is_left_out_with_its_reason(robot):
    (m, recording), *_ = measured(robot, 0, Friction())
    recording.stroke[recording.stroke == 1] = -1
    found, left_out = points(robot, [(m, recording)])
    assert not found
    assert left_out == [
        f"{m.id}: no window of constant velocity in both directions; repeat the measurement"
    ]
