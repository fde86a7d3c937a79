"""Motion of an axis before and between its recordings, from samples and plan."""

import numpy as np
import pytest

from hil.estimation.friction.points import history
from hil.model.robot import Robot
from hil.planning.measurement import Friction
from hil.planning.strokes import TURN
from hil.planning.trajectory import Trajectory
from hil.runs.recording import IDLE, Recording

AXIS = 1
BEGIN, RECORDED = 100.0, 10.0


@pytest.fixture(scope="module")
def robot():
    return Robot.load("manutec-r15")


def measurement(robot, **changes):
    return Friction(id="f", axis=AXIS + 1, q=(0.0,) * robot.n_joints, stroke=0.4, velocity=0.5,
                    acceleration=5.0, **changes)  # fmt: skip


def recording(robot, begin, *ends):
    """Return a recording in which the axis moves evenly through `ends`, one every 10 s."""
    time = np.linspace(0.0, RECORDED * (len(ends) - 1), 50 * (len(ends) - 1) + 1)
    q = np.zeros((len(time), robot.n_joints))
    q[:, AXIS] = np.interp(time, RECORDED * np.arange(len(ends)), ends)
    none = np.full(len(time), IDLE, np.int16)
    return Recording(begin + time, q, np.zeros_like(q), np.zeros(q.shape, np.uint8), none, none)


def test_while_recorded_an_axis_goes_as_fast_as_its_way_by_time_whatever_the_direction(robot):
    found = history(robot, [(measurement(robot), recording(robot, BEGIN, 0.0, 2.0, -1.0))])
    assert found.begin == BEGIN
    assert found.end == pytest.approx([BEGIN + 20.0])
    assert found.speed[0, AXIS] * robot.velocity_limit[AXIS] == pytest.approx(5.0 / 20.0)
    assert not np.delete(found.speed, AXIS, axis=1).any()


def test_between_recordings_an_axis_travels_from_the_end_of_one_to_the_begin_of_the_next(robot):
    recorded = [
        (measurement(robot), recording(robot, BEGIN, 0.0, 1.0)),
        (measurement(robot), recording(robot, BEGIN + 40.0, -2.0, 0.0)),
    ]
    found = history(robot, reversed(recorded))
    assert found.end == pytest.approx([BEGIN + 10.0, BEGIN + 40.0, BEGIN + 50.0])
    speed = found.speed[:, AXIS] * robot.velocity_limit[AXIS]
    assert speed == pytest.approx([0.1, 3.0 / 30.0, 0.2])


def test_an_exercise_comes_last_before_its_recording_at_the_mean_speed_of_its_strokes(robot):
    exercised = measurement(robot, exercise=12.0)
    recorded = [
        (measurement(robot), recording(robot, BEGIN, 0.0, 0.0)),
        (exercised, recording(robot, BEGIN + 40.0, 0.0, 0.0)),
    ]
    found = history(robot, recorded)
    assert found.end == pytest.approx(BEGIN + np.array([10.0, 28.0, 40.0, 50.0]))
    mean = 0.4 / (0.4 / 0.5 + 0.5 / 5.0 + TURN)
    speed = found.speed[:, AXIS] * robot.velocity_limit[AXIS]
    assert speed == pytest.approx([0.0, 0.0, mean, 0.0])


def test_an_exercise_longer_than_the_time_between_two_recordings_fills_it(robot):
    recorded = [
        (measurement(robot), recording(robot, BEGIN, 0.0, 0.0)),
        (measurement(robot, exercise=99.0), recording(robot, BEGIN + 30.0, 0.0, 0.0)),
    ]
    assert history(robot, recorded).end == pytest.approx(BEGIN + np.array([10.0, 30.0, 40.0]))


def test_a_run_without_recordings_has_an_empty_history(robot):
    found = history(robot, [])
    assert found.end.shape == (0,)
    assert found.speed.shape == (0, robot.n_joints)


@pytest.mark.parametrize(("first", "moved"), [(20.0, False), (300.0, True)])
def test_a_trajectory_that_begins_late_was_passed_before(robot, first, moved):
    motion = Trajectory.model_construct(id="t", cycles=2)
    found = history(robot, [(motion, recording(robot, first, 0.0, 1.0))])
    assert found.begin == (0.0 if moved else first)
    assert found.end == pytest.approx([first, first + 10.0] if moved else [first + 10.0])
    assert found.speed[:, AXIS] * robot.velocity_limit[AXIS] == pytest.approx(0.1)
