"""Backlash is identified from the link's motion within the gap, without false alarms."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from free_run import PERIOD, TRUTH, arm, recorded, some_motion

from hil.estimation.drive_train import directly_driven
from hil.estimation.excluded.backlash import half_gap, nearest
from hil.estimation.excluded.proof import proved
from hil.model.dynamics import inverse_dynamics, mass_matrix

if TYPE_CHECKING:
    from free_run import FreeRecorded
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STEP = 1e-4
"""Step of the simulation [s]; a sample is the mean over all steps in a period."""


def torque_of_gap(seed: int, axis: int, gap: float) -> Array:
    """Return the torque change by a gap with stiff, damped walls, shape (n, 2)."""
    robot, t = arm(), np.arange(0.0, 12.0, STEP)
    q, qd, qdd = some_motion(t, seed)
    rigid = inverse_dynamics(robot, TRUTH, q, qd, qdd)
    M = mass_matrix(robot, TRUTH, q)[:, axis, axis]
    stiffness, damping = 4e5, 2.0 * np.sqrt(4e5 * M.max())
    x, v = -gap * np.sign(rigid[0, axis]), 0.0
    moved = np.zeros((3, len(t), 2))
    for n in range(len(t)):
        depth = x - np.clip(x, -gap, gap)
        wall = stiffness * depth + damping * v if depth else 0.0
        if wall * depth < 0.0:
            wall = 0.0  # walls only push
        a = (-rigid[n, axis] - wall) / M[n]
        v += STEP * a
        x += STEP * v
        moved[:, n, axis] = x, v, a
    change = inverse_dynamics(robot, TRUTH, q + moved[0], qd + moved[1], qdd + moved[2]) - rigid
    each = round(PERIOD / STEP)
    mean = change[: len(t) // each * each].reshape(-1, each, 2).mean(axis=1)
    # the mean refers to the middle of the samples, half a period later
    at = np.arange(len(mean))
    return np.column_stack([np.interp(at - 0.5, at, x) for x in mean.T])


def add_gap(data: FreeRecorded, axis: int, gap: float) -> FreeRecorded:
    found = []
    for seed, (motion, recording) in enumerate(data):
        change = torque_of_gap(seed, axis, gap)[: len(recording.tau)]
        found.append((motion, replace(recording, tau=recording.tau + change)))
    return found


@pytest.fixture(scope="module")
def good() -> FreeRecorded:
    return recorded(arm(), TRUTH, n=3, duration=12.0)


@pytest.mark.parametrize(("axis", "gap"), [(0, 7e-4), (1, 5e-4), (1, 1e-3)])
def test_backlash_is_named_with_its_axis_and_its_size(
    good: FreeRecorded, axis: int, gap: float
) -> None:
    proof = proved(arm(), add_gap(good, axis, gap))
    assert proof is not None
    first, *_ = proof.found
    assert (first.cause, first.axes) == ("backlash", (axis + 1,))
    assert first.size == pytest.approx(np.degrees(gap), rel=0.25)


def add_twist(data: FreeRecorded, axis: int, compliance: float) -> FreeRecorded:
    """Return the link angle less compliance times transmitted torque, as in an elastic gear."""
    robot, found = arm(), []
    for seed, (motion, recording) in enumerate(data):
        t = np.arange(len(recording.tau)) * PERIOD
        q, qd, qdd = some_motion(t, seed)
        rigid = inverse_dynamics(robot, TRUTH, q, qd, qdd)
        twist = np.zeros_like(q)
        twist[:, axis] = -compliance * rigid[:, axis]
        speed = np.gradient(twist, PERIOD, axis=0)
        moved = q + twist, qd + speed, qdd + np.gradient(speed, PERIOD, axis=0)
        change = inverse_dynamics(robot, TRUTH, *moved) - rigid
        found.append((motion, replace(recording, tau=recording.tau + change)))
    return found


@pytest.mark.parametrize(("axis", "share"), [(0, 0.7), (1, 0.3)])
def test_the_error_of_a_fitted_compliance_is_no_other_cause(
    good: FreeRecorded, axis: int, share: float
) -> None:
    compliance = 2e-4
    twisted = add_twist(good, axis, compliance)
    fitted = replace(
        directly_driven(arm()),
        lag=np.zeros(2),
        compliance=share * compliance * (np.arange(2) == axis),
        soft=np.arange(2) == axis,
        p=TRUTH,
    )
    proof = proved(arm(), twisted, drive_train=fitted)
    assert proof is not None
    assert not proof.found


def test_a_gear_without_a_gap_is_not_accused(good: FreeRecorded) -> None:
    proof = proved(arm(), good)
    assert proof is not None
    assert not proof.found


def test_the_smallest_backlash_is_stated_of_each_axis_once(good: FreeRecorded) -> None:
    proof = proved(arm(), good)
    assert proof is not None
    own = [limit for limit in proof.limits if limit.cause == "backlash"]
    assert [limit.axis for limit in own] == [1, 2]
    assert all(limit.size is not None and 0.0 < limit.size < 0.2 for limit in own)


def test_a_gap_is_stated_in_the_unit_of_its_joint() -> None:
    assert half_gap(arm(), ("backlash 400", 0)) == pytest.approx(np.degrees(4e-4))
    assert half_gap(arm(), ("joint offset", 0)) is None
    assert nearest(("backlash 420", 1)) == ("backlash 400", 1)
    assert nearest(("torque ripple 3", 1)) == ("torque ripple 3", 1)
