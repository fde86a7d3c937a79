"""A mistake in what is stated of a robot is named, with its axis and its size."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import arm, recorded

from hil.estimation.mistakes import reading
from hil.estimation.mistakes.evidence import channels
from hil.estimation.mistakes.finding import find_mistake
from hil.estimation.mistakes.misfit import Campaign
from hil.estimation.mistakes.mistake import MistakeName as Name
from hil.estimation.mistakes.reading import Reading, Slip
from hil.estimation.signals import signals
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.robot import Robot, parse_robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from free_run import FreeRecorded
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Change = Callable[[Array, Array, Array], None]

TRUTH = {"Izz1": 6.0, "sx1": 8.0, "Izz2": 1.2, "sx2": 2.0}
"""Of an arm whose centres of mass are on its links' own axes."""


@pytest.fixture(scope="module")
def robot() -> Robot:
    return parse_robot(arm().text.replace("  - sy\n", ""), "arm.yaml")


@pytest.fixture(scope="module")
def good(robot: Robot) -> FreeRecorded:
    p = np.array([TRUTH[head] for head in base_parameters(robot).heads])
    return recorded(robot, p, n=3, duration=12.0)


def changed(data: FreeRecorded, change: Change) -> FreeRecorded:
    """The recordings with another q and tau; `change` sees the time since the first began, too."""
    found = []
    for number, (motion, recording) in enumerate(data):
        q, tau = recording.q.copy(), recording.tau.copy()
        time = recording.time + 20.0 * number
        change(q, tau, time)
        found.append((motion, replace(recording, q=q, tau=tau, time=time)))
    return found


def position_sign(q: Array, _tau: Array, _time: Array) -> None:
    q[:, 1] *= -1


def torque_sign(_q: Array, tau: Array, _time: Array) -> None:
    tau[:, 0] *= -1


def direction(q: Array, tau: Array, _time: Array) -> None:
    q[:, 1] *= -1
    tau[:, 1] *= -1


def exchange(q: Array, tau: Array, _time: Array) -> None:
    for x in (q, tau):
        x[:] = x[:, ::-1].copy()


def zero(q: Array, _tau: Array, _time: Array) -> None:
    q[:, 1] -= np.radians(20.0)


def constant(_q: Array, tau: Array, _time: Array) -> None:
    tau[:, 1] /= 1.3


def gear(q: Array, tau: Array, _time: Array) -> None:
    q[:, 0] *= 0.5
    tau[:, 0] /= 0.5


def slip(q: Array, _tau: Array, time: Array) -> None:
    q[time > 19.0, 1] -= np.radians(10.0)


def drifting(_q: Array, tau: Array, time: Array) -> None:
    tau[:, 1] *= 1.0 - 0.05 * time / 50.0


def spring(q: Array, tau: Array, _time: Array) -> None:
    tau[:, 1] += 10.0 * q[:, 1]


def meshing(q: Array, tau: Array, _time: Array) -> None:
    tau[:, 1] += 3.0 * np.sin(12 * q[:, 1] + 0.5)


def limit(_q: Array, tau: Array, _time: Array) -> None:
    np.clip(tau[:, 0], -60.0, 60.0, out=tau[:, 0])


def test_the_regressor_of_the_stated_motion_is_computed_once(
    robot: Robot, good: FreeRecorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[object, ...]] = []

    def counting(of: Robot, *motion: Array, joints: list[int], gravity: Array) -> Array:
        asked.append((id(of), *joints, *(each.tobytes() for each in (*motion, gravity))))
        return regressor(of, *motion, joints=joints, gravity=gravity)

    monkeypatch.setattr(reading, "regressor", counting)
    find_mistake(robot, changed(good, constant))
    assert asked.count(asked[0]) == 1


def test_nothing_is_named_where_nothing_is_wrong(robot: Robot, good: FreeRecorded) -> None:
    assert find_mistake(robot, good) is None


def test_noise_does_not_count_as_misfit(robot: Robot, good: FreeRecorded) -> None:
    rng = np.random.default_rng(4)
    loud = changed(good, lambda _q, tau, _t: tau.__iadd__(rng.normal(scale=3.0, size=tau.shape)))
    prepared = [(motion, signals(recording)) for motion, recording in loud]
    stated = Reading.stated(robot)
    misfit = Campaign(channels(robot, prepared), stated).explain(stated).misfit
    assert misfit == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("change", "name", "axes", "words"),
    [
        (position_sign, Name.POSITION_SIGN, (2,), "position has the wrong sign"),
        (torque_sign, Name.TORQUE_SIGN, (1,), "torque has the wrong sign"),
        (direction, Name.DIRECTION, (2,), "counts the other way round"),
        (exchange, Name.EXCHANGED, (1, 2), "each has the recordings of the other"),
        (constant, Name.TORQUE_CONSTANT, (2,), r"torques are 1\.[23]\d* ± 0\.0\d+ times"),
        (gear, Name.GEAR, (1,), r"2[45]\.?\d* for 50"),
        (slip, Name.SLIP, (2,), r"slipped by (9\.\d|10\.\d) ± 0\.\d+ degrees"),
        (spring, Name.SPRING, (2,), r"grows with its position by (9\.9|10)\d* ± 0\.\d+ N m/rad"),
        (meshing, Name.PERIODIC, (2,), r"torque of (2\.9|3)\d* ± 0\.\d+ N m repeats 12 times"),
        (limit, Name.SATURATION, (1,), "one and the same greatest torque, 60 N m"),
    ],
)
def test_a_mistake_is_named_with_axis_and_size(
    robot: Robot,
    good: FreeRecorded,
    change: Change,
    name: Name,
    axes: tuple[int, ...],
    words: str,
) -> None:
    found = find_mistake(robot, changed(good, change))
    assert found is not None
    assert (found.name, found.axes) == (name, axes)
    assert re.search(words, found.detail), found.detail
    assert found.remedy


def test_a_zero_that_a_load_explains_as_well_comes_with_it_and_homing_is_not_advised(
    robot: Robot, good: FreeRecorded
) -> None:
    # a first moment across the last link, which the robot file leaves out, turns gravity as well
    found = find_mistake(robot, changed(good, zero))
    assert found is not None
    assert (found.name, found.axes) == (Name.LEFT_OUT, (2,))
    assert found.other is not None
    assert (found.other.name, found.other.axes) == (Name.ZERO, (2,))
    assert re.search(
        r"a load on it.*; or axis 2: its zero is off by (19\.\d|20\.\d) ± 0\.\d+ degrees: the same"
        " in these data",
        str(found),
    )
    assert "home" not in found.remedy


def test_a_torque_constant_that_drifts_is_no_slip(robot: Robot, good: FreeRecorded) -> None:
    found = find_mistake(robot, changed(good, drifting))
    assert found is not None
    assert (found.name, found.axes) == (Name.DRIFT, (2,))


def test_a_slip_beyond_the_range_of_its_axis_is_none(robot: Robot, good: FreeRecorded) -> None:
    prepared = [(motion, signals(recording)) for motion, recording in good]
    stated = Reading.stated(robot)
    campaign = Campaign(channels(robot, prepared), stated)
    assert not campaign.beyond(stated)
    assert not campaign.beyond(replace(stated, slip=Slip(1, 10.0, np.radians(5.0))))
    assert campaign.beyond(replace(stated, slip=Slip(1, 10.0, np.radians(-166.0))))


def test_gravity_that_comes_from_elsewhere_is_named(robot: Robot, good: FreeRecorded) -> None:
    leaning = robot.text.replace("- -9.81\n- 0.0", "- -4.905\n- -8.496")
    assert leaning != robot.text
    found = find_mistake(parse_robot(leaning, "leaning.yaml"), good)
    assert found is not None
    assert found.name == Name.GRAVITY
    assert re.search(r"off by (58|59|60|61)\.\d ± ", found.detail), found.detail


@pytest.mark.parametrize("key", ["acceleration_limit", r"\w+_limit"])
def test_a_robot_of_unknown_limits_is_judged_by_what_was_reached(
    robot: Robot, good: FreeRecorded, key: str
) -> None:
    without = parse_robot(re.sub(rf"({key}): .*", r"\1: unknown", robot.text), "arm.yaml")
    assert not np.isfinite(without.acceleration_limit).any()
    assert find_mistake(without, good) is None
    for change, name in (
        (torque_sign, Name.TORQUE_SIGN), (zero, Name.LEFT_OUT), (gear, Name.GEAR),
        (slip, Name.SLIP),
    ):  # fmt: skip
        found = find_mistake(without, changed(good, change))
        assert found is not None
        assert found.name == name  # a zero of the last axis is the same as a load
