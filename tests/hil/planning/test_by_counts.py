"""Planning by counts: enough measurements, spread, inside the limits, reproducible."""

import numpy as np
import pytest

from hil.model.robot import Robot, parse_robot
from hil.planning.design.by_counts import COUNTS, design
from hil.planning.dry_run import dry_run
from hil.planning.plan import dump_plan
from hil.planning.prediction.identifiability import identifiability


@pytest.fixture(scope="module")
def robot():
    return Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def plan(robot):
    return design(robot)


def select(plan, kind):
    return [m for m in plan.measurements if m.kind == kind]


def test_it_has_its_counts_and_takes_as_long_as_the_paper_s_campaign(robot, plan):
    result = dry_run(plan, robot)
    assert COUNTS == {"gravity": 56, "inertia": 80, "coupling": 16}
    assert {kind: len(select(plan, kind)) for kind in COUNTS} == COUNTS
    assert not result.problems
    assert 33 * 60 < result.duration < 35 * 60


def test_every_parameter_is_identifiable(robot, plan):
    for group in identifiability(plan, robot):
        assert group.complete, group
        assert group.condition < 50, group


def test_only_axes_that_show_something_are_measured(plan):
    assert {m.axis for m in select(plan, "gravity")} == {2, 3, 4, 5}
    assert {m.axis for m in select(plan, "inertia")} == {1, 2, 3, 4, 5, 6}
    assert {(m.axis, m.partner.axis) for m in select(plan, "coupling")} == {(1, 2)}


def test_motor_phases_are_spread(robot, plan):
    for axis in range(1, 7):
        starts = [m.start[axis - 1] for m in select(plan, "inertia") if m.axis == axis]
        phase = np.exp(1j * robot.gear_ratio[axis - 1] * np.array(starts))
        assert abs(phase.mean()) < 0.6, f"axis {axis}"


def test_configurations_of_an_axis_differ(robot, plan):
    for kind in ("gravity", "coupling"):
        places = {tuple(np.round(m.q, 2)) for m in select(plan, kind)}
        assert len(places) == len(select(plan, kind))


def test_the_same_robot_gives_the_same_plan(robot, plan):
    assert dump_plan(design(robot)) == dump_plan(plan)


def test_too_few_measurements_are_refused(robot):
    with pytest.raises(ValueError, match="2 measurements for the gravity group must be at least 3"):
        design(robot, {"gravity": 2, "inertia": 92, "coupling": 9})


def test_a_robot_with_all_link_parameters_gets_a_complete_plan(robot):
    lines = [line for line in robot.text.splitlines() if "parameters:" not in line]
    full = parse_robot("\n".join(lines).partition("ties:")[0], "full.yaml")
    plan = design(full, {"gravity": 80, "inertia": 120, "coupling": 30})
    assert len(plan.measurements) == 230
    assert not dry_run(plan, full).problems
    for group in identifiability(plan, full):
        assert group.complete, group
