"""Plans stay inside the robot's ranges, however short these are."""

from __future__ import annotations

import re
import warnings

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.model.robot import Robot, parse_robot
from hil.planning.design.by_counts import design
from hil.planning.design.by_minutes import design_within
from hil.planning.dry_run import dry_run
from hil.planning.prediction.noise import stated_noise

FEW = {"gravity": 8, "inertia": 20, "coupling": 4}


def changed(robot: Robot, **values: float) -> Robot:
    """Return the robot with other values in all joints."""
    text = robot.text
    for key, value in values.items():
        text = re.sub(rf"{key}: [-\d.]+", f"{key}: {value}", text)
    return parse_robot(text, "changed")


def gantry(ways: tuple[float, ...], speed: float) -> Robot:
    """Return a robot with prismatic axes along y, x and z of the base."""
    turns = [("-pi/2", "0"), ("pi/2", "pi/2"), ("pi/2", "pi/2")]
    return Robot.create(
        "gantry",
        [
            {
                "type": "prismatic",
                "frame": {"alpha": alpha, "theta": theta},
                "q_min": 0.0,
                "q_max": way,
                "velocity_limit": speed,
                "acceleration_limit": 5.0,
                "torque_limit": 500.0,
                "drive": {"gear_ratio": 300.0, "rotor_inertia": 1e-4, "torque_constant": 0.5},
            }
            for (alpha, theta), way in zip(turns, ways, strict=True)
        ],
    )


def planned(robot: Robot) -> list[str]:
    """Return the dry run's problems with a plan of few measurements."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plan = design(robot, FEW)
    return [problem.message for problem in dry_run(plan, robot).problems]


def test_ranges_of_20_degrees_either_way_get_shorter_strokes(manutec: Robot) -> None:
    assert planned(changed(manutec, q_min=-0.35, q_max=0.35)) == []


def test_a_direct_drive_has_no_room_to_turn_its_motor_once(manutec: Robot) -> None:
    assert planned(changed(manutec, gear_ratio=1, q_min=-0.5, q_max=0.5)) == []


def test_a_short_way_at_high_speed(manutec: Robot) -> None:
    assert planned(gantry((0.2, 0.2, 0.2), speed=1.0)) == []


def test_what_cannot_creep_long_enough_is_declared_impossible(manutec: Robot) -> None:
    short = changed(manutec, q_min=-0.2, q_max=0.2)
    with pytest.raises(
        ValueError, match=r"axis 1 can creep for .* s in 0\.2 rad, must be at least"
    ):
        design(short, FEW)


def test_a_range_in_which_the_estimator_would_use_no_sample_is_declared_impossible(
    manutec: Robot,
) -> None:
    short = changed(manutec, q_min=-0.1, q_max=0.1)
    with pytest.raises(
        ValueError,
        match=r"axis 3 reaches 0\.2 rad/s .* gravity, in strokes of 0\.1 rad; it must be at least"
        r" 0\.29 rad/s, 0\.055 of its velocity limit: widen the range, lower velocity_limit",
    ):
        design(short, FEW)


def test_slow_accelerations_get_longer_ramps(manutec: Robot) -> None:
    assert planned(changed(manutec, acceleration_limit=1.5)) == []


@pytest.mark.long
def test_by_minutes_too(manutec: Robot) -> None:
    short = changed(manutec, q_min=-0.4, q_max=0.4)
    assert dry_run(design_within(short, 10.0, stated_noise(short)), short).problems == ()


@settings(deadline=None, max_examples=15)
@given(
    middle=st.floats(-1.0, 1.0),
    half=st.floats(0.02, 2.5),
    speed=st.floats(0.5, 6.0),
    acceleration=st.floats(1.0, 50.0),
    gear=st.floats(1.0, 200.0),
)
def test_any_limits_give_a_plan_that_passes_or_the_reason_why_not(
    manutec: Robot, middle: float, half: float, speed: float, acceleration: float, gear: float
) -> None:
    low, high = (f"{middle + sign * half:.4f}" for sign in (-1, 1))
    robot = changed(
        manutec, q_min=low, q_max=high, velocity_limit=f"{speed:.3f}",
        acceleration_limit=f"{acceleration:.3f}", gear_ratio=f"{gear:.2f}",
    )  # fmt: skip
    try:
        problems = planned(robot)
    except ValueError as error:
        problems, reason = [], str(error)
    else:
        reason = "must be at least"
    assert problems == []
    assert "must be at least" in reason


def test_lengths_are_in_metres_in_messages() -> None:
    robot = gantry((0.5, 0.5, 0.5), speed=1.0)
    plan = design(robot, FEW)
    far = plan.measurements[0].model_copy(update={"q": (0.25, 0.25, 480.0)})
    (problem,) = dry_run(plan.model_copy(update={"measurements": (far,)}), robot).problems[:1]
    assert "480" in problem.message
    assert "rad" not in problem.message
    assert "is it in millimetres? then write 0.48" in problem.message
