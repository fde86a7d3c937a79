"""Unsuitable strokes: one message each, with the remedy."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, classical, recorded
from stroke_run import campaign, recorded_strokes, strokes

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.back_and_forth import NAME
from hil.estimation.identify import default_method, estimate
from hil.model.dynamics import inverse_dynamics

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

ROBOT = arm()


def ways(forth: tuple[float, float], back: tuple[float, float], speeds: tuple[float, float]) -> (
    tuple[FreeMotion, Recording]
):  # fmt: skip
    """Return two pairs of strokes of axis 2 at constant speeds, and the motions in between."""
    stretches, numbers, at = [], [], forth[0]
    for number in range(4):
        (begin, end), speed = ((forth, speeds[0]), (back, speeds[1]))[number % 2]
        for first, last, own in ((at, begin, -1), (begin, end, number)):
            n = round(abs(last - first) / speed / PERIOD)
            stretches.append(np.linspace(first, last, n))
            numbers.append(np.full(n, own, np.int16))
        at = end
    q2 = np.concatenate(stretches)
    q = np.column_stack([np.zeros_like(q2), q2])
    qd = np.gradient(q, PERIOD, axis=0)
    tau = inverse_dynamics(ROBOT, TRUTH, q, qd, 0 * q) + classical(qd)
    motion, recording = recorded_strokes(PERIOD * np.arange(len(q)), q, tau, axis=1)
    return motion, replace(recording, stroke=np.concatenate(numbers))


def refused(*data: tuple[FreeMotion, Recording]) -> str:
    """Return the message of the refusal."""
    with pytest.raises(NotEnoughData) as caught:
        estimate(ROBOT, list(data), NAME)
    return str(caught.value)


def test_no_recording_of_that_kind() -> None:
    assert refused(*recorded(ROBOT, TRUTH, n=1)) == (
        "no strokes of a single axis among the recordings; import some with kind:"
        " {back_and_forth: JOINT} in the map, or omit --method"
    )


def test_one_stroke_only() -> None:
    motion, recording = strokes(ROBOT, TRUTH, 1, (0.0, 0.5), pairs=1)
    forth_only = replace(recording, stroke=np.where(recording.stroke == 0, 0, -1).astype(np.int16))
    message = refused((motion, forth_only))
    assert (
        "no forward stroke with a backward stroke after it; record at least one pair, or write"
        in (message)
    )


def test_speeds_that_differ_too_much() -> None:
    message = refused(ways((0.0, 1.0), (1.0, 0.0), (0.5, 1.0)))
    assert "s: pair 1: forward at 0.501 rad/s, backward at 1 rad/s, a ratio above 1.5" in message
    assert "(and 1 more pair)" in message
    assert "move in both directions at the same speed, or write kind: free" in message


def test_strokes_over_different_ways() -> None:
    message = refused(ways((0.0, 1.0), (2.2, 1.2), (0.5, 0.5)))
    assert "forward 0.0882 to 0.998 rad, backward 1.2 to 2.2 rad" in message
    assert "1 bins of position in common, at least 4 needed" in message
    assert "move both strokes over the same range" in message


def test_strokes_that_are_over_before_the_low_pass_is() -> None:
    motion, recording = strokes(ROBOT, TRUTH, 1, (0.0, 0.5), period=0.4, way=0.05)
    message = refused((motion.model_copy(update={"cut_off": 2.0}), recording))
    assert "a stroke is too short for the low-pass" in message


def test_a_pair_of_no_use_is_named_and_the_others_are_used() -> None:
    data = campaign(ROBOT, TRUTH)
    motion, recording = data[0]
    stroke = np.where(recording.stroke == 3, -1, recording.stroke).astype(np.int16)
    found = estimate(ROBOT, [(motion, replace(recording, stroke=stroke)), *data[1:]], NAME)
    assert [left.id for left in found.left_out] == [motion.id]
    assert found.left_out[0].reason.startswith("pair 2: a stroke is too short")
    np.testing.assert_allclose(found.values, TRUTH, atol=0.02)


def test_another_axis_that_moves_too_is_accounted_for_and_stated() -> None:
    data = campaign(ROBOT, TRUTH)
    motion, recording = data[-1]
    time = recording.time[:, np.newaxis]
    w, size = 2.0, 0.1
    added = [np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time)]
    only_first = np.array([1.0, 0.0])
    q = recording.q + size * added[0] * only_first
    before, now = (
        inverse_dynamics(ROBOT, TRUTH, x, *_rates(recording.q, moving))
        for x, moving in (
            (recording.q, None),
            (q, [size * each * only_first for each in added[1:]]),
        )
    )
    moved = replace(recording, q=q, tau=recording.tau + now - before)
    found = estimate(ROBOT, [*data[:-1], (motion, moved)], NAME)
    assert any(
        "besides the stated axis, axis 1 moved in s2-5" in remark
        for remark in found.details.remarks
    )
    np.testing.assert_allclose(found.values, TRUTH, atol=0.03)


def _rates(q: Array, added: list[Array] | None) -> list[Array]:
    """Return smooth velocities and accelerations of counted positions, and their errors."""
    half = 6
    qd = np.gradient(q, PERIOD, axis=0)
    kernel = np.ones(2 * half + 1) / (2 * half + 1)
    qd = np.column_stack([np.convolve(x, kernel, mode="same") for x in qd.T])
    qdd = np.column_stack(
        [np.convolve(x, kernel, "same") for x in np.gradient(qd, PERIOD, axis=0).T]
    )
    return [qd, qdd] if added is None else [qd + added[0], qdd + added[1]]


def test_one_pair_alone_says_what_it_cannot_show() -> None:
    found = estimate(ROBOT, campaign(ROBOT, TRUTH, pairs=1), NAME)
    assert any("have one pair of strokes" in each for each in found.details.remarks)
    np.testing.assert_allclose(found.values, TRUTH, atol=0.1)


def test_torques_of_unknown_worth_are_left_to_the_method_that_finds_it() -> None:
    motion, recording = strokes(ROBOT, TRUTH, 1, (0.0, 0.5))
    unknown = motion.model_copy(update={"unknown_gains": (2,)})
    assert default_method([unknown])[0] == "free motion"
    with pytest.raises(NotIdentifiable, match=r"the gain of axis 2 is unknown.*'free motion'"):
        estimate(ROBOT, [(unknown, recording)], NAME)
