"""Samples with common friction: periods, blocks, and pairs of forward and backward strokes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import TRUTH, arm, recorded
from stroke_run import campaign, curved

from hil.estimation.condensed import groups, stack
from hil.estimation.excluded.proof import proved
from hil.estimation.identify import estimate
from hil.estimation.signals import signals

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

ROBOT = arm()


@pytest.fixture(scope="module")
def strokes() -> list[tuple[FreeMotion, Recording]]:
    return campaign(ROBOT, TRUTH, unloaded_friction)


def unloaded_friction(qd: Array, time: Array, load: Array) -> Array:
    return curved(qd, time, 0.0 * load)


def test_a_group_of_imported_strokes_is_a_pair_and_all_pairs_count(
    strokes: list[tuple[FreeMotion, Recording]],
) -> None:
    for motion, recording in strokes:
        s = signals(recording)
        found = list(stack(ROBOT, motion, s))
        assert len(found) == motion.cycles
        for (only,) in found:
            forth, back = (np.sum(s.stroke[only.index] % 2 == way) for way in (0, 1))
            assert min(forth, back) > 0.3 * len(only.index)


def test_thinned_rows_are_some_of_all_rows(strokes: list[tuple[FreeMotion, Recording]]) -> None:
    for motion, recording in strokes:
        s = signals(recording)
        some, every = (stack(ROBOT, motion, s, thin) for thin in ((4,) * ROBOT.n_joints, ()))
        for (few,), (all_of_them,) in zip(some, every, strict=True):
            at = np.isin(all_of_them.index, few.index)
            assert np.array_equal(all_of_them.index[2::4], few.index)
            for name in ("torques", "X", "friction"):
                np.testing.assert_array_equal(getattr(few, name), getattr(all_of_them, name)[at])


def test_a_group_of_a_free_motion_is_a_block() -> None:
    ((_, recording),) = recorded(ROBOT, TRUTH, n=1)
    first, second = groups(signals(recording))
    assert np.array_equal(first, ~second)


def test_measurements_of_strokes_are_one_group() -> None:
    ((_, recording),) = recorded(ROBOT, TRUTH, n=1)
    (every,) = groups(signals(replace(recording, group=None)))
    assert every.all()


def test_gravity_of_imported_strokes_is_not_taken_for_friction_of_one_direction(
    strokes: list[tuple[FreeMotion, Recording]],
) -> None:
    found = estimate(ROBOT, strokes, "improved")
    np.testing.assert_allclose(found.values, TRUTH, atol=0.05)


def test_a_mistake_in_the_map_of_imported_strokes_is_found(
    strokes: list[tuple[FreeMotion, Recording]],
) -> None:
    geared = []
    for motion, recording in strokes:
        q, tau = recording.q.copy(), recording.tau.copy()
        q[:, 1] /= 1.5
        tau[:, 1] *= 1.5
        geared.append((motion, replace(recording, q=q, tau=tau)))
    right, wrong = proved(ROBOT, strokes), proved(ROBOT, geared)
    assert right is not None
    assert wrong is not None
    assert not right.found
    assert (wrong.found[0].cause, wrong.found[0].axes) == ("gear ratio", (2,))
