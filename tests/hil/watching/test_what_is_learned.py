"""Quantities learned by a watch without pushes: distances, friction level, scatter."""

import numpy as np
import pytest

from checked_files.yaml_file import FileError
from hil.planning.plan import Plan, repeat_measurements
from hil.watching.detector import Scatter, window_lengths
from hil.watching.friction import DISTANCES, FrictionLevel, Turning, columns_of

PERIOD = 0.004


def back_and_forth() -> np.ndarray:
    """Return steps of two axes that swing by 0.1 rad."""
    t = PERIOD * np.arange(2000)
    q = 0.1 * np.sin(np.outer(t, (2.0, 3.0)))
    return np.diff(q, axis=0, prepend=q[:1])


def directions(step: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Return directions of friction after Dahl."""
    none = np.zeros_like(step)
    return Turning(distance, PERIOD).take(step, none, none, none).direction


def test_a_presliding_distance_is_found_from_reversals() -> None:
    step, level = back_and_forth(), np.full((2000, 2), 50.0)
    true = directions(step, np.array([DISTANCES[5], DISTANCES[2]]))
    turning = Turning(np.zeros(2), PERIOD)
    turning.take(step, step / PERIOD, level * true, level)
    turning.settle()
    assert turning.distance == pytest.approx([DISTANCES[5], DISTANCES[2]])
    assert turning.damping == pytest.approx([0.0, 0.0], abs=0.1)


def test_damping_while_bristles_bend_is_found_with_the_distance() -> None:
    step, level = back_and_forth(), np.full((2000, 2), 50.0)
    qd, true = step / PERIOD, directions(step, np.array([DISTANCES[4], DISTANCES[3]]))
    damping = (400.0, 50.0) * (qd - np.abs(qd) * true)
    turning = Turning(np.zeros(2), PERIOD)
    turning.take(step, qd, level * true + damping, level)
    turning.settle()
    assert turning.distance == pytest.approx([DISTANCES[4], DISTANCES[3]])
    assert turning.damping == pytest.approx([400.0, 50.0])


def test_a_push_while_an_axis_turns_teaches_it_no_distance() -> None:
    step, level = back_and_forth(), np.full((2000, 2), 50.0)
    distances = np.array([DISTANCES[3], DISTANCES[2]])
    friction = level * directions(step, distances)
    turning = Turning(np.zeros(2), PERIOD)
    turning.take(step, 0 * step, friction, level)
    turning.settle()
    pushed = friction + np.array([180.0, 0.0])  # axis 1, 3.6 times as strong as friction
    turning.take(step, 0 * step, pushed, level)
    turning.settle(np.array([False, True]))
    assert turning.distance == pytest.approx(distances)
    turning.take(step, 0 * step, friction, level)
    turning.settle()
    assert turning.distance == pytest.approx(distances)


def test_a_standstill_teaches_no_distance() -> None:
    step, level = back_and_forth(), np.full((2000, 2), 50.0)
    friction = level * directions(step, np.array([DISTANCES[4], DISTANCES[3]]))
    turning = Turning(np.zeros(2), PERIOD)
    turning.take(step, 0 * step, friction, level)
    still = np.zeros((20_000, 2))  # held at the other end of its presliding, for 80 s
    turning.take(still, still, still - 50.0, still + 50.0)
    turning.settle()
    assert turning.distance == pytest.approx([DISTANCES[4], DISTANCES[3]])


def test_direction_is_doubtful_from_a_standstill_on_until_the_axis_has_moved() -> None:
    distance, level = np.full(2, DISTANCES[3]), np.full((2000, 2), 50.0)
    step = back_and_forth()
    turning = Turning(distance, PERIOD)
    turning.take(step, 0 * step, level * directions(step, distance), level)
    turning.settle()
    still = np.zeros((100, 2))
    assert np.all(turning.take(still, still, still, still + 50.0).doubt[-1] >= 1.0)
    off = np.full((200, 2), 4e-5)
    doubt = turning.take(off, off / PERIOD, off, off + 50.0).doubt
    assert np.all(doubt[5] > 0.5)
    assert np.all(doubt[-1] < 0.05)


def test_what_turns_for_the_first_time_is_not_judged() -> None:
    step = back_and_forth()
    first = Turning(np.zeros(2), PERIOD).take(step, 0 * step, step, np.ones_like(step))
    assert first.doubt[1:10].min() > 100


def test_a_presliding_distance_that_the_model_holds_stays() -> None:
    step, level = back_and_forth(), np.full((2000, 2), 50.0)
    turning = Turning(np.array([DISTANCES[4], 0.0]), PERIOD)
    turning.take(step, 0 * step, level * np.sign(step), level)
    turning.settle()
    assert turning.distance == pytest.approx([DISTANCES[4], DISTANCES[0]])


def test_direction_is_doubtful_after_a_reversal_alone() -> None:
    step = back_and_forth()
    turning = Turning(np.zeros(2), PERIOD)
    turning.take(step, 0 * step, np.sign(step), np.ones_like(step))
    turning.settle()
    turned = turning.take(step, 0 * step, np.sign(step), np.ones_like(step))
    after = np.cumsum(np.abs(step[:, 0])) % 0.2
    assert turned.doubt[after > 0.15, 0].max() < 0.05
    assert turned.doubt[:, 0].max() > 0.3


def test_friction_that_falls_by_a_tenth_in_minutes_is_followed() -> None:
    level, block = FrictionLevel(np.array([0.01]), np.array([0.05])), 62
    direction = np.tile([1.0, -1.0], block // 2)[:, np.newaxis]
    columns = columns_of(direction, np.full_like(direction, 0.2), np.full_like(direction, 0.3))
    used = np.ones((block, 1), dtype=bool)
    for number in range(720):  # three minutes
        true = -0.1 * number / 720 * 0.2 * direction
        level.follow(columns, true - level.evaluate(columns)[0], used, 0.25)
    found, error = level.evaluate(columns)
    assert found == pytest.approx(-0.02 * direction, abs=0.002)
    assert error.max() < 0.01


def test_friction_of_another_shape_than_the_law_is_followed_at_every_speed() -> None:
    level = FrictionLevel(np.array([0.01]), np.array([0.05]))
    speed = np.linspace(0.005, 0.8, 1240)[:, np.newaxis]
    columns = columns_of(np.ones_like(speed), np.full_like(speed, 0.2), speed)
    missing = 0.01 * np.sin(4 * np.log(speed))
    used = np.ones((62, 1), dtype=bool)
    for number in range(240):  # one minute: three passes of all speeds
        rows = slice(62 * (number % 20), 62 * (number % 20) + 62)
        level.follow(columns[rows], (missing - level.evaluate(columns)[0])[rows], used, 0.25)
    left = missing - level.evaluate(columns)[0]
    assert np.sqrt(np.mean(left**2)) < 0.3 * np.sqrt(np.mean(missing**2))


def test_friction_slower_than_the_law_was_found_from_is_doubtful_until_it_is_seen() -> None:
    level = FrictionLevel(np.array([0.01]), np.array([0.3]))
    one = np.ones((62, 1))
    slow, fast = (columns_of(one, 0.2 * one, speed * one) for speed in (0.02, 0.5))
    before = level.evaluate(slow)[1].max()
    assert before > 2 * level.evaluate(fast)[1].max()
    for _ in range(40):
        level.follow(slow, 0.0 * one, one > 0, 0.25)
    assert level.evaluate(slow)[1].max() < 0.25 * before


def test_what_nobody_used_teaches_nothing() -> None:
    level = FrictionLevel(np.array([0.01]), np.array([0.05]))
    scatter = Scatter(np.array([2, 3]), 1, PERIOD)
    columns = columns_of(*np.ones((3, 62, 1)))
    none = np.zeros((62, 1), dtype=bool)
    level.follow(columns, np.ones((62, 1)), none, 0.25)
    scatter.take(np.ones((62, 2, 1)), none)
    assert not level.evaluate(columns)[0].any()
    assert not scatter.rms.any()
    assert np.isinf(scatter.bound).all()


def test_scatter_from_little_motion_is_taken_for_what_it_may_be() -> None:
    windows, random = np.array([2, 25]), np.random.default_rng(0)
    scatter = Scatter(windows, 1, PERIOD)
    used, bounds = np.ones((25, 1), dtype=bool), []
    for _ in range(160):  # 16 s
        means = random.normal(size=(25, 2, 1)) * [[1.0], [0.3]]
        scatter.take(means, used)
        bounds.append(scatter.bound[:, 0])
    assert np.isinf(bounds[0][1])  # a single window of 0.1 s
    assert bounds[0][0] < 10
    assert 1.5 < bounds[9][1] / 0.3 < 4.0
    assert bounds[-1] == pytest.approx([1.0, 0.3], rel=0.1)


@pytest.mark.parametrize("period", [0.001, 0.002, 0.004, 0.01, 0.1])
def test_windows_grow_up_to_a_tenth_of_a_second(period: float) -> None:
    lengths = window_lengths(period)
    assert list(lengths) == sorted(set(lengths))
    assert lengths[0] == 2
    assert lengths[-1] == max(2, round(0.1 / period))


def test_rounds_of_a_plan_have_measurements_of_their_own(small_plan: Plan) -> None:
    thrice = repeat_measurements(small_plan, 3)
    assert len({m.id for m in thrice.measurements}) == 3 * len(small_plan.measurements)
    assert repeat_measurements(small_plan, 1) == small_plan


def test_an_id_that_leaves_no_room_for_a_number_is_refused(small_plan: Plan) -> None:
    long = small_plan.measurements[0].model_copy(update={"id": "x" * 63})
    with pytest.raises(FileError, match="give it a shorter id"):
        repeat_measurements(small_plan.model_copy(update={"measurements": (long,)}), 2)
