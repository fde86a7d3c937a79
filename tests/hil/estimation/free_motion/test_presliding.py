"""Presliding: friction changes sign over a distance, which is estimated from the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from free_run import COULOMB, PERIOD, TRUTH, VISCOUS, arm, recorded, some_motion
from hypothesis import given
from hypothesis import strategies as st

from hil.estimation.free_motion.nuisances import find_nuisances
from hil.estimation.free_motion.settings import processing_of
from hil.estimation.free_motion.survey import survey
from hil.estimation.identify import estimate
from hil.friction.direction import are_successive, friction_direction
from hil.friction.law import friction_torque
from hil.model.dynamics import inverse_dynamics
from hil.model.motors import motor_torque

DISTANCE = 2e-3
"""Presliding distance of the arm's friction [rad]."""


@given(
    steps=st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=40),
    distance=st.floats(1e-3, 1.0),
)
def test_the_direction_is_the_solution_of_dahls_equation(
    steps: list[float], distance: float
) -> None:
    q = np.append(0.0, np.cumsum(steps))
    z = 0.0
    for k, step in enumerate(np.diff(q)):
        # many small steps of Euler's method between two samples
        for _ in range(400):
            z += abs(step) / 400 * (np.sign(step) - z) / distance
        assert friction_direction(q, distance)[k + 1] == pytest.approx(z, abs=0.02)


def test_far_from_reversals_it_is_the_sign_of_the_velocity() -> None:
    q = np.concatenate([np.linspace(0, 1, 50), np.linspace(1, 0, 50)[1:]])
    z = friction_direction(q, 1e-4)
    assert z[1:50] == pytest.approx(1.0)
    assert z[50:] == pytest.approx(-1.0)


def test_an_axis_that_stands_still_has_no_direction() -> None:
    assert not friction_direction(np.full(20, 0.7), 1e-3).any()


def test_rows_are_successive_where_positions_change_as_velocities_say() -> None:
    q, qd, _ = some_motion(PERIOD * np.arange(500))
    assert are_successive(q, qd)
    order = np.random.default_rng(0).permutation(500)
    assert not are_successive(q[order], qd[order])
    assert not are_successive(q[:1], qd[:1])


def test_velocities_without_a_change_of_position_are_no_motion() -> None:
    _, qd, _ = some_motion(PERIOD * np.arange(500))
    assert not are_successive(np.zeros_like(qd), qd)


def test_rows_in_reverse_are_no_motion() -> None:
    q, qd, _ = some_motion(PERIOD * np.arange(500))
    assert not are_successive(q[::-1], qd[::-1])


def presliding_recordings() -> list:
    """Return recordings of small motions with friction that reverses over `DISTANCE`."""
    data = recorded(arm(), TRUTH, lambda qd: VISCOUS * qd, noise=0.1)
    slow = []
    for motion, each in data:
        z = np.column_stack([friction_direction(x, DISTANCE) for x in each.q.T])
        slow.append((motion, replace(each, tau=each.tau + COULOMB * z)))
    return slow


def test_the_distance_is_found_and_inertia_no_longer_takes_its_place() -> None:
    data = presliding_recordings()
    found, plain = (
        estimate(arm(), data, name) for name in ("free motion", "weighted least squares")
    )
    for axis in found.details.axes:
        assert axis.presliding == pytest.approx(DISTANCE, rel=0.25)
    assert found.details.overall_residual < 0.7 * plain.details.overall_residual
    error, of_plain = (np.linalg.norm(each.values - TRUTH) for each in (found, plain))
    assert error < 0.5 * of_plain


def test_static_friction_before_the_first_motion_is_no_evidence_against_presliding() -> None:
    distance, ((motion, each),) = 1e-3, recorded(arm(), TRUTH, n=1, duration=30.0)
    after = each.time[:, np.newaxis].clip(2.0, 3.0) - 2.0  # a smooth start
    t = (each.time - 2.0).clip(0.0) - after[:, 0] + after[:, 0] ** 2 / 2
    q, slope, bend = some_motion(t)
    qd, qdd = slope * after, bend * after**2 + slope * ((after > 0) & (after < 1))
    way = np.cumsum(np.abs(np.diff(q, axis=0, prepend=q[:1])), axis=0)
    z = np.column_stack([friction_direction(x, distance) for x in q.T])
    z += 0.9 * np.exp(-way / distance)
    tau = inverse_dynamics(arm(), TRUTH, q, qd, qdd) + motor_torque(arm(), q, qd, qdd)
    tau += COULOMB * z + VISCOUS * qd + 0.1 * np.random.default_rng(1).standard_normal(q.shape)
    seen = survey([(motion, replace(each, q=q, tau=tau))])
    processing = replace(processing_of(seen)[0], rests="level")
    found = find_nuisances(arm(), seen, processing, ["presliding"])
    assert found.processing.presliding == pytest.approx([distance] * 2, rel=0.5)


def test_friction_that_turns_round_at_once_keeps_the_sign() -> None:
    found = estimate(arm(), recorded(arm(), TRUTH), "free motion").details
    assert found is not None
    for axis in found.axes:
        assert axis.presliding < 1e-3 * axis.speed
        assert (axis.bend.standard_error > 0) == (axis.presliding > 0)


@pytest.mark.long
def test_torques_follow_the_way_where_rows_are_samples_of_a_motion() -> None:
    found = estimate(arm(), presliding_recordings(), "free motion").details
    assert found is not None
    law = found.law
    q, qd, _ = some_motion(PERIOD * np.arange(500))
    load = np.zeros_like(q)
    in_order = friction_torque(arm(), law, q, qd, load)
    alone = np.array(
        [friction_torque(arm(), law, *row, np.zeros(2)) for row in zip(q, qd, strict=True)]
    )
    reversed_lately = np.abs(qd) < 0.02
    assert np.abs(in_order - alone)[reversed_lately].max() > 0.5 * COULOMB.min()
    assert in_order[np.abs(qd) > 0.5] == pytest.approx(alone[np.abs(qd) > 0.5], rel=0.05, abs=0.2)
