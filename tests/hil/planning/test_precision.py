"""Predictions of precision agree with the scatter of the estimator's normal equations."""

import re

import numpy as np
import pytest
from scipy import stats

from checked_files.yaml_file import FileError
from hil.estimation import condensed
from hil.estimation.signals import derivatives, signals
from hil.friction.equation import FEWEST, usable
from hil.least_squares.window import noise_gain, weights
from hil.model.base_parameters import base_parameters
from hil.model.robot import parse_robot
from hil.planning.design.by_counts import design
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.prediction.information import (
    Information,
    covariance,
    forecast,
    predict,
    shares,
    torque_scale,
)
from hil.planning.prediction.noise import Differences, Noise, stated_noise
from hil.runs.recording import IDLE, Recording

PERIOD = 0.004
DRAWS = 600


@pytest.fixture(scope="module")
def plan(manutec):
    return design(manutec, {"gravity": 8, "inertia": 16, "coupling": 2})


@pytest.fixture(scope="module")
def one_of_each(plan):
    """Return a measurement of every kind, with the axis whose torque is read."""
    return {m.kind: m for m in reversed(plan.measurements)}


def ideal(measurement, period=PERIOD):
    """Return signals of axes that follow their profiles exactly; torques are zero."""
    planned = forecast(measurement, period)
    n = len(planned.time)
    idle, flags = np.full(n, IDLE, np.int16), np.zeros(planned.q.shape, np.uint8)
    tau = np.zeros_like(planned.q)
    return signals(Recording(planned.time, planned.q, tau, flags, idle, idle))


def deviations(robot, measurements, noise):
    return predict(robot, measurements, PERIOD, noise).deviation


@pytest.mark.parametrize("kind", ["gravity", "inertia", "coupling"])
def test_the_information_foreseen_is_what_the_estimator_takes_from_an_ideal_motion(
    manutec, one_of_each, kind
):
    measurement = one_of_each[kind]
    (stacked,) = condensed.stack(manutec, measurement, ideal(measurement))
    planned = shares(manutec, measurement, PERIOD)
    assert [item.axis for item in planned] == [item.axis for item in stacked]
    for before, taken in zip(planned, stacked, strict=True):
        after = taken.condensed()
        assert before.n == pytest.approx(after.n, rel=0.03)
        base = base_parameters(manutec)
        expected, found = np.diag(before.information), np.diag(after.product)[2:]
        shown = np.flatnonzero(found[: len(base)] > 1e-6 * found[: len(base)].max())
        meant = np.intersect1d(shown, base.groups[ELEMENT_KINDS[kind].group])
        assert shown.size
        assert expected[meant] / found[meant] == pytest.approx(1.0, abs=0.02)
        # quantities visible on a ramp only depend on one sample more or less
        assert expected[shown] / found[shown] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("period", [0.008, 0.016])
@pytest.mark.parametrize(("kind", "share"), [("inertia", 0.005), ("coupling", 0.02)])
def test_samples_of_a_slow_sync_are_used_where_differences_give_the_acceleration(
    manutec, one_of_each, kind, share, period
):
    """Position delays and joint offsets were named where a corner of another axis was in reach."""
    measurement = one_of_each[kind]
    s, exact = ideal(measurement, period), forecast(measurement, period).qdd
    error = np.abs(s.smoothed(s.qdd) - s.smoothed(exact))
    for axis in measurement.moved:
        used = s.usable(manutec, axis)
        assert used.sum() >= FEWEST
        assert (error[used] <= share * manutec.acceleration_limit).all()


@pytest.mark.parametrize("what", ["white", "wander"])
@pytest.mark.parametrize("kind", ["gravity", "inertia"])
def test_noise_scatters_the_normal_equations_as_foreseen(manutec, one_of_each, kind, what):
    """X'e of the estimator's own products, for many draws of e."""
    measurement = one_of_each[kind]
    axis, s = measurement.index, ideal(measurement)
    drawn = np.random.default_rng(4).standard_normal((len(s.time), DRAWS))
    if what == "wander":
        walk = np.cumsum(np.sqrt(PERIOD) * drawn, axis=0)
        drawn = np.sign(s.qd[:, axis])[:, np.newaxis] * walk
    used = s.valid & usable(manutec, s, axis)
    everything = [np.ones(len(s.time), dtype=bool)]
    (stacked,) = condensed.stack_axis(manutec, s, axis, drawn, used, everything)
    n_base = len(base_parameters(manutec))
    scores = stacked.condensed().product[DRAWS:, :DRAWS][:n_base]
    expected = getattr(shares(manutec, measurement, PERIOD)[0], what)[:n_base, :n_base]
    size = np.sqrt(np.diag(expected))
    scaled = expected / np.outer(size, size).clip(min=1e-300)
    found = np.sum((scores[size > 0] / size[size > 0, np.newaxis]) ** 2) / DRAWS
    freedom = DRAWS * np.trace(scaled) ** 2 / np.sum(scaled**2)
    low, high = stats.chi2.ppf([0.001, 0.999], freedom) / freedom
    assert low * 0.95 < found / np.trace(scaled) < high * 1.05


def coarse(robot, increments=4096):
    """Return the robot without gears, with this number of increments per turn of the joint."""
    stated = re.sub(r"gear_ratio: [\d.]+", "gear_ratio: 1", robot.text)
    return parse_robot(
        stated.replace("drive: {", f"drive: {{encoder_resolution: {increments}, "), "coarse.yaml"
    )


@pytest.mark.parametrize("kind", ["gravity", "inertia"])
def test_rounded_positions_scatter_the_normal_equations_as_foreseen(manutec, one_of_each, kind):
    """X'e for e = M times the acceleration error by rounding, for any zero of the encoder."""
    measurement, robot = one_of_each[kind], coarse(manutec, 20000)
    axis, s = measurement.index, ideal(measurement)
    increment = 2 * np.pi / 20000
    zeros = np.random.default_rng(5).uniform(0, increment, DRAWS)
    shifted = s.q[:, axis : axis + 1] + zeros
    error = increment * np.round(shifted / increment) - shifted
    accelerations = derivatives(error, PERIOD)[1]
    used = s.valid & usable(robot, s, axis)
    everything = [np.ones(len(s.time), dtype=bool)]
    (stacked,) = condensed.stack_axis(robot, s, axis, accelerations, used, everything)
    n_base = len(base_parameters(robot))
    scores = stacked.condensed().product[DRAWS:, :DRAWS][:n_base]
    positions = Differences(PERIOD, np.ones(6))
    expected = np.diag(shares(robot, measurement, PERIOD, positions)[0].rounding)[:n_base]
    meant = np.intersect1d(
        np.flatnonzero(expected > 1e-6 * expected.max()),
        base_parameters(robot).groups[ELEMENT_KINDS[kind].group],
    )
    found = np.mean(scores[meant] ** 2, axis=1) / (increment**2 / 12)
    assert np.sqrt(found / expected[meant]) == pytest.approx(1.0, rel=0.5)


def test_coarse_encoders_on_direct_drives_make_a_plan_imprecise(manutec, plan):
    robot = coarse(manutec)
    few, many = (stated_noise(coarse(manutec, n)) for n in (4096, 2**22))
    ratio = deviations(robot, plan.measurements, few) / deviations(robot, plan.measurements, many)
    assert min(ratio) > 1.5
    assert max(ratio) > 8
    source = predict(robot, plan.measurements, PERIOD, few).source
    assert "axis 1, 2, 3, 4, 5, 6: encoder resolution causes more noise than the torque" in source


def test_what_coarse_encoders_hide_of_an_inertia_is_foreseen(manutec):
    """Least squares over accelerations of rounded positions, half of the time at 0.4 of a limit."""
    robot, increment = coarse(manutec), 2 * np.pi / 4096
    noise, axis = stated_noise(robot), 1
    limit = 0.4 * robot.acceleration_limit[axis]
    a = limit * np.repeat(np.tile([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0], 20), 100)
    q = np.cumsum(np.cumsum(a)) * PERIOD**2
    exact, rounded = (
        np.convolve(derivatives(x[:, np.newaxis], PERIOD)[1][:, 0], weights(PERIOD), "valid")
        for x in (q, increment * np.round(q / increment))
    )
    found = 1.0 - (rounded @ exact) / (rounded @ rounded)
    assert found > 0.005
    assert noise.lost(robot, PERIOD)[axis] == pytest.approx(found, rel=0.5)
    source = noise.sampled(robot, PERIOD).source
    assert f"about {100 * noise.lost(robot, PERIOD)[0]:.2g}, " in source
    assert not stated_noise(manutec).lost(manutec, PERIOD).any()


def test_behind_gears_increments_hardly_count(manutec, plan):
    increments = 2 * np.pi / 4096 / manutec.gear_ratio
    with_them, without = (
        deviations(manutec, plan.measurements, stated_noise(manutec, increments=each))
        for each in (increments, None)
    )
    assert with_them / without == pytest.approx(1.0, abs=0.1)


def test_increments_that_nobody_states_are_said_to_be_left_out(manutec):
    assert "encoder resolution not stated: its noise is left out" in stated_noise(manutec).source
    assert "left out" not in stated_noise(manutec, increments=[1e-5] * 6).source


def test_a_resolution_below_one_increment_is_refused(manutec):
    text = manutec.text.replace("drive: {", "drive: {encoder_resolution: 0.5, ", 1)
    with pytest.raises(FileError, match=r"0\.5 must be between 1 and 2\^32 increments per turn"):
        parse_robot(text, "mine.yaml")


def test_smoothing_leaves_of_white_noise_what_the_gain_says(manutec, one_of_each):
    planned = forecast(one_of_each["gravity"], PERIOD)
    noise = np.random.default_rng(1).standard_normal((len(planned.time), 50))
    assert planned.smoothed(noise).var() == pytest.approx(noise_gain(PERIOD), rel=0.05)


def test_twice_the_measurements_lower_every_deviation_by_the_root_of_two(manutec, plan):
    noise = stated_noise(manutec)
    once = deviations(manutec, plan.measurements, noise)
    twice = deviations(manutec, plan.measurements * 2, noise)
    assert once / twice == pytest.approx(np.sqrt(2), rel=1e-3)


def test_twice_the_noise_doubles_every_deviation(manutec, plan):
    noise = stated_noise(manutec)
    louder = Noise(2 * noise.torque, 2 * noise.wander, "")
    ratio = deviations(manutec, plan.measurements, louder) / deviations(
        manutec, plan.measurements, noise
    )
    assert ratio == pytest.approx(2.0, rel=1e-6)


def test_friction_that_wanders_spoils_gravity_most(manutec, plan):
    calm = Noise(stated_noise(manutec).torque, np.zeros(6), "")
    restless = Noise(calm.torque, 0.01 * manutec.torque_limit, "")
    ratio = deviations(manutec, plan.measurements, restless) / deviations(
        manutec, plan.measurements, calm
    )
    groups = base_parameters(manutec).groups
    assert min(ratio[list(groups["gravity"])]) > 2
    assert max(ratio[list(groups["diagonal"])]) < min(ratio[list(groups["gravity"])])


def test_what_is_not_identifiable_is_infinitely_uncertain(manutec, plan):
    sixth = [m for m in plan.measurements if m.kind == "inertia" and m.axis == 6]
    found, names = (
        predict(manutec, sixth, PERIOD, stated_noise(manutec)),
        base_parameters(manutec).names,
    )
    identifiable = dict(zip(names, np.isfinite(found.deviation), strict=True))
    assert identifiable.pop("p14")
    assert not any(identifiable.values())
    assert not found.imprecise[names.index("p14")]
    assert found.imprecise[names.index("p1")]


def test_what_rounding_leaves_of_a_column_determines_no_parameter():
    rounding = Information(np.diag([1.0, 1e-31, 1.0]), np.diag([1.0, 1e-31, 1.0]))
    assert np.diag(covariance(rounding, 2)).tolist() == [1.0, np.inf]


def test_a_unit_of_a_parameter_weighs_most_where_limits_are_small(manutec):
    """1 kg m2 is negligible for joint 1 with 945 N m and large for joint 6 with 75 N m."""
    scale = dict(zip(base_parameters(manutec).names, torque_scale(manutec), strict=True))
    assert scale["p14"] > 10 * scale["p1"]
    # p1 appears in joint 1 alone, p14 as Izz6 in joint 6: rms of a uniformly distributed
    # acceleration
    assert scale["p1"] == pytest.approx(15 / np.sqrt(3) / 945, rel=0.05)


def test_the_robot_file_may_state_noise_and_the_drives_add_their_resolution(manutec):
    joint = "    torque_limit: 945\n"
    text = manutec.text.replace(joint, f"{joint}    torque_noise: 4.0\n    friction_wander: 2.5\n")
    robot = parse_robot(text, "mine.yaml")
    noise = stated_noise(robot, resolution=[12.0, 0, 0, 0, 0, 0])
    assert noise.torque[0] == pytest.approx(np.hypot(4.0, 12 / np.sqrt(12)))
    assert noise.wander[0] == 2.5
    assert noise.torque[1] == pytest.approx(0.0025 * 1890)
    assert robot.digest != manutec.digest


def test_noise_beyond_the_torque_limit_is_refused(manutec):
    joint = "    torque_limit: 945\n"
    text = manutec.text.replace(joint, f"{joint}    torque_noise: 1200\n")
    with pytest.raises(FileError, match="1200 must be positive and below torque_limit = 945"):
        parse_robot(text, "mine.yaml")
