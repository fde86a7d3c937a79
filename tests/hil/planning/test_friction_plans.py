"""Plans for friction: speed sweeps, motion with stops, characteristics in operation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hil
from hil.planning.design.friction import INTERVAL, SLOWEST, STOPS, operation, stops, sweep
from hil.planning.dry_run import dry_run
from hil.planning.plan import Plan, dump_plan
from hil.planning.timetable import SETTLING
from hil.planning.workspace import Box, Workspace


@pytest.fixture(scope="module")
def robot():
    return hil.Robot.load("manutec-r15")


@pytest.fixture(scope="module")
def swept(robot):
    return sweep(robot)


def test_a_sweep_reaches_from_creep_to_the_speed_limit_of_every_axis(robot, swept):
    for axis in range(robot.n_joints):
        speeds = [m.velocity for m in swept.measurements if m.index == axis]
        limit = robot.velocity_limit[axis]
        assert min(speeds) == pytest.approx(SLOWEST * limit, rel=1e-3)
        assert max(speeds) == pytest.approx(limit, rel=1e-6)


def test_every_plan_passes_its_dry_run_and_promises_no_base_parameters(robot, swept):
    for planned in (swept, stops(robot, 1), operation(robot, 2)):
        result = dry_run(planned, robot)
        assert not result.problems
        assert not result.groups


def test_speeds_are_taken_in_an_order_without_trend(swept):
    speeds = np.log([m.velocity for m in swept.measurements if m.index == 0])
    order = np.corrcoef(np.arange(len(speeds)), speeds)[0, 1]
    assert abs(order) < 0.35


def test_creeping_strokes_span_a_turn_of_the_motor(robot, swept):
    for m in swept.measurements:
        begin, end = m.profile(0).window
        turn = 2 * np.pi / robot.gear_ratio[m.index]
        assert (end - begin) * m.velocity > turn or end - begin > 0.45


def test_motion_with_stops_measures_the_torque_every_twelve_seconds(robot):
    planned = stops(robot, 1)
    steady = [m for m in planned.measurements if m.exercise]
    for m in steady:
        assert m.duration + SETTLING == pytest.approx(INTERVAL, abs=2.0)
    assert [m.rest for m in planned.measurements if m.rest] == list(STOPS)


def test_operation_time_passes_between_characteristics(robot):
    planned = operation(robot, 1, times=(0.0, 600.0, 1200.0), speeds=5)
    begins, now = [], 0.0
    for m in planned.measurements:
        if m.id.endswith("-01"):
            begins.append(now + m.preparation)
        now += m.duration + SETTLING
    assert begins == pytest.approx([0.0, 600.0, 1200.0], abs=1.0)


@settings(max_examples=20, deadline=None)
@given(speeds=st.integers(4, 30), slowest=st.floats(0.001, 0.1), axis=st.integers(0, 5))
def test_a_sweep_read_back_equals_the_one_written(robot, tmp_path_factory, speeds, slowest, axis):
    from hil.planning.plan import load_plan

    planned = sweep(robot, [axis], speeds, slowest)
    path = tmp_path_factory.mktemp("plan") / "plan.yaml"
    path.write_text(dump_plan(planned))
    assert load_plan(path, robot) == planned
    assert not dry_run(planned, robot).problems


def test_an_axis_without_room_for_its_ramps_is_swept_as_fast_as_it_can_go(robot):
    workspace = Workspace(ranges={3: (-0.4, 0.4)})
    planned = sweep(robot, [2], workspace=workspace)
    assert isinstance(planned, Plan)
    fastest = max(m.velocity for m in planned.measurements)
    assert 1.0 < fastest < robot.velocity_limit[2]
    assert not dry_run(planned, robot).problems


def test_an_axis_that_cannot_pass_its_range_clear_of_boxes_is_refused(robot):
    everywhere = Box(name="ceiling", low=(-3, -3, -3), high=(3, 3, 3))
    with pytest.raises(ValueError, match="axis 1 cannot pass its range clear"):
        sweep(robot, [0], workspace=Workspace(boxes=(everywhere,)))
