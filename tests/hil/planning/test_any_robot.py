"""A plan of any robot passes its own dry run, or the reason is stated."""

from __future__ import annotations

import math
import warnings
from functools import partial
from typing import TYPE_CHECKING

import pytest
import yaml
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from hil.model.base_parameters import RegroupingFailed, base_parameters
from hil.model.robot import Robot
from hil.planning.design import by_minutes, candidates
from hil.planning.design.by_counts import design
from hil.planning.design.by_minutes import design_within
from hil.planning.design.trajectories import Search, design_trajectory
from hil.planning.dry_run import dry_run
from hil.planning.plan import Plan, PlannedRobot, dump_plan
from hil.planning.prediction.information import predict
from hil.planning.prediction.noise import stated_noise

if TYPE_CHECKING:
    from collections.abc import Callable

QUICK = Search(random=4, refined=1, steps=2)
REASON = "must be at least"
EVERY = 25
"""Interval of measurements with a prediction, which takes as long as a design."""


@st.composite
def joints(draw: st.DrawFn) -> dict[str, object]:
    """Draw a joint of any range, with limits that may differ greatly."""
    revolute = draw(st.booleans())
    half = draw(st.sampled_from([0.35, 1.0, 2.9] if revolute else [0.1, 0.5])) * draw(
        st.floats(0.5, 1.0)
    )
    middle = draw(st.sampled_from([0.0, -1.0, 0.8]))
    speed = half * draw(st.floats(0.5, 8.0))
    ramp = draw(st.floats(0.05, 1.2))
    places = {key: draw(st.sampled_from(["0", "0.3", "-0.45"])) for key in ("d", "r")}
    return {
        "type": "revolute" if revolute else "prismatic",
        "frame": {
            "alpha": draw(st.sampled_from(["0", "pi/2", "-pi/2", "pi", "0.3"])),
            "theta": draw(st.sampled_from(["0", "pi/2", "0.7"])),
            **places,
        },
        "q_min": middle - half,
        "q_max": middle + half,
        "velocity_limit": speed,
        "acceleration_limit": speed / ramp,
        "torque_limit": draw(st.floats(5.0, 2000.0)),
        "drive": {
            "gear_ratio": draw(st.sampled_from([1.0, 50.0, 200.0])),
            "rotor_inertia": 1e-4,
            "torque_constant": 0.2,
            "encoder_resolution": draw(st.sampled_from([None, 4096.0])),
        },
    }


@st.composite
def robots(draw: st.DrawFn, most: int = 7) -> Robot:
    """Draw a chain of any axes under gravity of any direction."""
    turn, tilt = draw(st.floats(0.0, 6.3)), draw(st.sampled_from([0.0, 0.4, math.pi / 2]))
    gravity = (
        9.81 * math.sin(tilt) * math.cos(turn),
        9.81 * math.sin(tilt) * math.sin(turn),
        -9.81 * math.cos(tilt),
    )
    robot = Robot.create(
        "any", draw(st.lists(joints(), min_size=2, max_size=most)), gravity=gravity
    )
    try:
        base_parameters(robot)
    # nearly perpendicular gravity is refused, as nearly perpendicular axes are
    except RegroupingFailed:
        reject()
    return robot


def holds(robot: Robot, planned: Callable[[], Plan]) -> None:
    """Check that a plan passes after writing and reading, or has a reason to be impossible."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            plan = planned()
        except ValueError as error:
            plan, reason = None, str(error)
        if plan is None:
            assert REASON in reason
            assert "validation error" not in reason
            return
        written = Plan.model_validate(yaml.safe_load(dump_plan(plan)))
        found = dry_run(written, robot)
        predict(robot, written.measurements[::EVERY], 0.004, stated_noise(robot))
    assert [problem.message for problem in found.problems] == []


@settings(max_examples=12)
@given(robots())
def test_by_counts(robot: Robot) -> None:
    holds(robot, lambda: design(robot))


@settings(max_examples=8)
@given(robots(most=3), st.booleans())
def test_by_minutes(robot: Robot, with_trajectories: bool) -> None:
    def planned() -> Plan:
        return design_within(robot, 12.0, stated_noise(robot), with_trajectories=with_trajectories)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(by_minutes, "pool", partial(candidates.pool, each=4))
        patch.setattr(candidates, "SEARCH", QUICK)
        holds(robot, planned)


@settings(max_examples=12)
@given(robots(most=4))
def test_trajectories(robot: Robot) -> None:
    def planned() -> Plan:
        wave = design_trajectory(robot, cycles=3, search=QUICK)
        about = PlannedRobot(name=robot.name, digest=robot.digest)
        return Plan(robot=about, measurements=(wave,))

    holds(robot, planned)
