"""Unknown gains in a map are estimated with the parameters, or refused with a reason."""

from __future__ import annotations

import numpy as np
import pytest
from free_run import TRUTH, arm
from free_run import recorded as two_axes
from hypothesis import given, settings
from hypothesis import strategies as st
from twin_recordings import TwinRecorder, scale_gains

from hil.errors import Mismatch, NotIdentifiable
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.free_motion.variants import VARIANTS
from hil.estimation.identify import estimate
from hil.model.robot import Robot

NO_ROTORS = {"rotor_inertia": 0.0}


def fit_of(robot: Robot, data, method: str = "free motion"):
    found = estimate(robot, data, method)
    assert isinstance(found.details, FreeMotionFit)
    return found, {each.axis: each for each in found.details.gains}


@pytest.mark.parametrize("method", VARIANTS)
def test_every_method_finds_a_gain_by_what_the_axes_share(method: str) -> None:
    robot = arm(**NO_ROTORS)
    found, gains = fit_of(robot, scale_gains(two_axes(robot, TRUTH), {1: 40.0}), method)
    assert gains[1].value == pytest.approx(40.0, rel=5e-3)
    assert gains[1].unit == "N m"
    assert abs(gains[1].value - 40.0) < 4 * gains[1].standard_error
    assert (np.abs(found.values - TRUTH) < 4 * found.standard_errors).all()
    assert (found.residual < 0.3).all()  # N m, after the gain


def test_rotors_of_known_inertia_fix_the_gains_of_all_axes() -> None:
    robot = arm()
    found, gains = fit_of(robot, scale_gains(two_axes(robot, TRUTH), {1: 0.02, 2: 50.0}))
    for axis, truth in ((1, 0.02), (2, 50.0)):
        assert abs(gains[axis].value - truth) < 4 * gains[axis].standard_error
        assert gains[axis].standard_error < 0.05 * truth
    assert (np.abs(found.values - TRUTH) < 4 * found.standard_errors).all()


@pytest.mark.parametrize(("unknown", "lost"), [
    ((1, 2), "axes 1, 2 and with them p1, p2, p3, p4, p5, p6"), ((2,), None),
])  # fmt: skip
def test_a_scale_that_nothing_fixes_is_refused_by_name(unknown, lost) -> None:
    robot = arm(**NO_ROTORS)
    data = scale_gains(two_axes(robot, TRUTH), dict.fromkeys(unknown, 3.0))
    if lost is None:
        assert fit_of(robot, data)[1][2].value == pytest.approx(3.0, rel=0.01)
        return
    with pytest.raises(NotIdentifiable) as refused:
        estimate(robot, data, "free motion")
    assert lost in str(refused.value)
    assert "only up to scale" in str(refused.value)
    assert "state one gain in the map or a rotor_inertia" in str(refused.value)


def test_an_axis_that_shares_nothing_with_others_is_refused_alone() -> None:
    joint = {
        "type": "prismatic", "q_min": -3.0, "q_max": 3.0, "velocity_limit": 3.0,
        "acceleration_limit": 20.0, "torque_limit": 90.0, "parameters": ["m"],
        "drive": {"gear_ratio": 50.0, "rotor_inertia": 0.0, "torque_constant": 0.1},
    }  # fmt: skip
    portal = Robot.create(
        "portal",
        [joint | {"frame": {"alpha": 0}}, joint | {"frame": {"alpha": "pi/2"}}],
        gravity=(0.0, 0.0, -9.81),
    )
    data = scale_gains(two_axes(portal, np.array([9.0, 4.0])), {1: 3.0})
    with pytest.raises(NotIdentifiable, match="gain of axis 1 and with it p1 are determined only"):
        estimate(portal, data, "free motion")


def test_noise_of_the_signal_shifts_no_gain_and_intervals_hold_the_truth() -> None:
    twin, gain = TwinRecorder("scara"), 0.1
    held, shift = [], []
    for seed in range(10):
        data = scale_gains(twin.recorded(seed, n=1, noise=5.0), {1: gain})
        found, gains = fit_of(twin.robot, data)
        shift.append((gains[1].value - gain) / gains[1].standard_error)
        held += (np.abs(found.values - twin.truth) <= found.half_width()).tolist()
    assert np.mean(held) >= 0.9
    assert np.abs(shift).max() < 3.5
    assert abs(np.mean(shift)) < 3.0 / np.sqrt(len(shift))


@settings(max_examples=3)
@given(factor=st.floats(1e-4, 1e4))
def test_parameters_do_not_depend_on_the_unit_of_an_unknown_gain(factor: float) -> None:
    robot = arm(**NO_ROTORS)
    data = two_axes(robot, TRUTH, n=1)
    one, other = (fit_of(robot, scale_gains(data, {1: g}))[0] for g in (1.0, factor))
    assert other.values == pytest.approx(one.values, rel=1e-6)
    assert other.standard_errors == pytest.approx(one.standard_errors, rel=1e-4)


def test_recordings_that_disagree_on_which_gain_is_unknown_are_refused() -> None:
    robot = arm()
    data = two_axes(robot, TRUTH, n=2)
    data[:1] = scale_gains(data[:1], {1: 2.0})
    with pytest.raises(Mismatch, match="state the gain of an axis in all maps"):
        estimate(robot, data, "free motion")


def test_methods_for_strokes_name_the_one_that_finds_gains() -> None:
    robot = arm()
    with pytest.raises(NotIdentifiable, match="--method 'free motion'"):
        estimate(robot, scale_gains(two_axes(robot, TRUTH, n=1), {1: 2.0}), "improved")
