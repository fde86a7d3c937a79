"""Friction intervals widen at speeds and after motion outside the recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil.friction.law import (
    AxisLaw,
    FrictionLaw,
    TermValue,
    friction_torque,
    friction_variance,
    level_along,
)
from hil.friction.search import axis_law
from hil.friction.terms import OF_SPEED
from hil.friction.warmth import (
    COLD_TO_WARM,
    COURSES,
    Exposure,
    History,
    lost_degrees,
    states_at,
)
from hil.least_squares.blocks import Blocks
from hil.model.robot import Robot

LIMIT = 4.0
LEVELS = 0.97, 1.0, 1.03, 1.0, 0.98, 1.02
NOISE = 0.05


def degressive(v: np.ndarray) -> np.ndarray:
    """Return friction that decreases towards rest like an arc tangent [N m]."""
    return np.asarray(np.sign(v) * (8.0 + 8.0 * 2 / np.pi * np.arctan(np.abs(v) / 0.3)) + 2.0 * v)


def blocks(slowest: float, levels: tuple[float, ...] = LEVELS) -> Blocks:
    """Return measurements at speeds from `slowest` to 0.9 of the limit, forward and backward."""
    one_way = np.linspace(slowest, 0.9 * LIMIT, 60)
    v = np.append(one_way, -one_way)
    u, sign = v / LIMIT, np.sign(v)
    columns = {
        "offset": np.ones_like(u), "Coulomb": sign, "viscous": u, "asymmetric": np.abs(u),
        "cube root": np.cbrt(u), "arc tangent": np.arctan(u / 0.08), "quadratic": u * np.abs(u),
        "load": 0 * u,
    }  # fmt: skip
    X = np.column_stack([columns[term] for term in OF_SPEED])
    rng, products = np.random.default_rng(1), []
    for level in levels:
        y = level * degressive(v) + NOISE * rng.standard_normal(len(v))
        whole = np.column_stack([y, X])
        products.append(whole.T @ whole)
    counts = np.full((len(levels), 1), float(len(v)))
    return Blocks((), tuple(OF_SPEED), np.array(products)[:, np.newaxis], counts)


def law(slowest: float, past: History | None = None) -> AxisLaw:
    time = 60.0 * np.arange(len(LEVELS))
    return axis_law(blocks(slowest), LIMIT, (slowest, 0.9 * LIMIT), time, past, 0)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot.load("emps")


def half(robot: Robot, found: AxisLaw, v: np.ndarray) -> np.ndarray:
    qd = v[:, np.newaxis]
    alone = FrictionLaw(axes=(found,))
    return 1.96 * np.sqrt(friction_variance(robot, alone, 0 * qd, qd, 0 * qd)[:, 0])


def test_intervals_widen_outside_the_speeds_of_the_law_and_hold_what_friction_does_there(
    robot: Robot,
) -> None:
    found = law(0.25 * LIMIT)
    v = np.array([0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 0.9]) * LIMIT
    width = half(robot, found, v)
    assert (np.diff(width[:5]) < 0).all()
    assert found.extrapolation(v[4:]) == pytest.approx(0.0, abs=1e-12)
    speed = found.known(v)
    stated = np.array([found.extrapolation(each) for each in v])
    level = sum(
        found.terms[term].value * OF_SPEED[term].column(_samples(speed)) for term in found.terms
    ) + found.slope * (v - speed)
    off = np.abs(degressive(v) - level)
    assert (off[:3] > 1.0).all()  # the law continues in a straight line, friction does not
    assert (off < 1.96 * np.hypot(stated, found.wander * level)).all()


def _samples(v: np.ndarray) -> object:
    from hil.friction.direction import Direction
    from hil.friction.terms import _Samples

    one = np.ones_like(v)
    return _Samples(v / LIMIT, Direction(one, 0 * one), 0 * v, 0 * v)


def test_intervals_of_few_measurements_contain_friction_of_another_shape(robot: Robot) -> None:
    slowest, time = 0.03 * LIMIT, 60.0 * np.arange(4)
    measured = blocks(slowest, (0.995, 1.0, 1.005, 1.0))
    noise = NOISE**2 * float(measured.counts.sum())
    found = axis_law(measured, LIMIT, (slowest, 0.9 * LIMIT), time, None, 0, noise)
    assert found.law == "Coulomb and viscous"  # four measurements show no other law
    v = np.linspace(slowest, 0.9 * LIMIT, 60)
    level = found.terms["Coulomb"].value + found.terms["viscous"].value * v / LIMIT
    inside = np.abs(degressive(v) - level) < half(robot, found, v)
    assert inside.mean() >= 0.9


def test_a_law_from_slow_to_fast_is_sure_where_one_from_fast_alone_is_not() -> None:
    slow, fast = (law(share * LIMIT) for share in (0.03, 0.25))
    v = np.array([0.03, 0.05, 0.1]) * LIMIT
    assert slow.extrapolation(v) == pytest.approx(0.0, abs=1e-12)
    assert (fast.extrapolation(v) > 0.5).all()


def test_the_less_an_axis_has_gone_through_what_its_law_saw_the_wider_the_interval() -> None:
    end = 60.0 * np.arange(1, len(LEVELS) + 1)
    resting = History(end, np.full((len(end), 1), 0.02), -60.0)
    found = law(0.1 * LIMIT, resting).exposure
    assert found is not None
    assert len(found.states) == len(COURSES)
    assert found.slope >= COLD_TO_WARM
    assert 0.01 < found.scatter < 0.04

    moving = History(end, np.full((len(end), 1), 0.5), 0.0)
    axis = law(0.1 * LIMIT, resting)
    alike, unlike = (
        level_along(FrictionLaw(axes=(axis,)), past, end)[1][:, 0] for past in (resting, moving)
    )
    assert (np.diff(unlike) > 0).all()
    assert unlike[-1] > 3 * alike[-1]
    assert float(found.deviation(found.anywhere)) > alike.max()


def test_measurements_that_showed_more_change_widen_intervals_more() -> None:
    states = np.linspace(0.0, 0.2, 6)[:, np.newaxis] * np.ones(len(COURSES))
    calm, wild = (
        Exposure.compute(states, size * np.linspace(1.0, -1.0, 6), 2) for size in (0.01, 0.07)
    )
    assert calm.slope == COLD_TO_WARM
    assert wild.slope == pytest.approx(0.7)
    assert Exposure.compute(states, np.linspace(1.0, -1.0, 6), 2).slope == 1.0
    assert wild.deviation(0.1) > calm.deviation(0.1) > calm.deviation(0.0) == calm.scatter


def test_a_motion_through_the_states_of_the_measurements_is_covered_and_a_faster_one_is_not() -> (
    None
):
    end = 60.0 * np.arange(1, 41)
    past = History(end, np.full((len(end), 1), 0.3), 0.0)
    states, rng = states_at(past, 0, end), np.random.default_rng(3)
    found = Exposure.compute(states, 0.02 * rng.standard_normal(len(end)), 2)
    assert found.covers(past, 0)
    faster = History(end, np.full((len(end), 1), 0.9), 0.0)
    assert not found.covers(faster, 0)
    assert found.level_along(faster, 0, end)[1][-1] > found.level_along(past, 0, end)[1][-1]


def test_a_motion_that_ends_in_known_states_but_leads_through_others_is_not_covered() -> None:
    warm = History(
        np.array([600.0, *(600.0 + 60.0 * np.arange(1, 41))]), np.full((41, 1), 0.3), 0.0
    )
    states, rng = states_at(warm, 0, warm.end[1:]), np.random.default_rng(3)
    found = Exposure.compute(states, 0.002 * rng.standard_normal(40), 1.0)
    cold = History(warm.end[-1:], np.full((1, 1), 0.3), 0.0)
    assert found.unexplored(states_at(cold, 0, cold.end)) < found.left
    assert not found.covers(cold, 0)


def test_what_measurements_left_open_agrees_with_the_posterior_of_independent_slopes() -> None:
    rng = np.random.default_rng(4)
    states = rng.uniform(0.0, 0.3, (30, len(COURSES)))
    found = Exposure.compute(states, 0.01 * rng.standard_normal(30), 3)
    X, x = states - states.mean(axis=0), rng.uniform(0.0, 0.5, (5, len(COURSES)))
    prior = np.eye(len(COURSES)) * len(COURSES) / found.slope**2
    posterior = np.linalg.inv(prior + X.T @ X / found.left**2)
    x -= states.mean(axis=0)
    expected = np.sqrt(np.einsum("nk,kl,nl->n", x, posterior, x))
    np.testing.assert_allclose(found.unexplored(x + states.mean(axis=0)), expected, rtol=0.05)


def test_intervals_of_a_repeated_motion_have_the_width_of_what_the_measurements_saw() -> None:
    end = 60.0 * np.arange(1, 31)
    past = History(end, np.full((len(end), 1), 0.3), 0.0)
    states, rng = states_at(past, 0, end), np.random.default_rng(5)
    change = -0.2 * (states[:, 4] - states[:, 4].mean())
    found = Exposure.compute(states, change + 0.01 * rng.standard_normal(len(end)), 2)
    assert found.left == pytest.approx(0.01, rel=0.25)
    assert found.covers(past, 0)
    predicted, u = found.level_along(past, 0, end)
    again = change + 0.01 * rng.standard_normal(len(end))
    assert 0.9 <= np.mean(np.abs(again - predicted) <= 1.96 * u) <= 1.0
    assert np.sqrt(np.mean(u**2)) < 0.015


def test_friction_of_a_repeated_motion_follows_the_course_of_its_level(robot: Robot) -> None:
    end = 60.0 * np.arange(1, 21)
    past, warming = History(end, np.full((20, 1), 0.3), 0.0), 1.0 - 0.01 * np.arange(20)
    levels = tuple((warming + np.resize([0.01, -0.01], 20)).tolist())
    middle, speeds = end - 30.0, (0.03 * LIMIT, 0.9 * LIMIT)
    found = axis_law(blocks(speeds[0], levels), LIMIT, speeds, middle, past, 0)
    alone, v = FrictionLaw(axes=(found,)), np.full((20, 1), 0.5 * LIMIT)
    change, _ = level_along(alone, past, middle)
    friction = friction_torque(robot, alone, 0 * v, v, 0 * v, change=change)[:, 0]
    assert friction == pytest.approx(degressive(v[0])[0] * warming, rel=0.02)  # 0.1 without


def test_measurements_at_the_same_speeds_lose_one_degree_to_a_law_of_several_terms() -> None:
    levels, values = blocks(0.03 * LIMIT).only((), ("Coulomb", "viscous")), np.array([9.0, 7.0])
    assert lost_degrees(levels, values) == pytest.approx(1.0)
    rng = np.random.default_rng(6)
    rows = [(np.ones(9), np.full(9, speed)) for speed in np.linspace(0.05, 0.9, 8)]
    products = []
    for terms in rows:
        whole = np.column_stack([0.0 * terms[0], *terms])
        products.append(whole.T @ whole)
    slow_and_fast = replace(levels, products=np.array(products)[:, np.newaxis])
    lost = lost_degrees(slow_and_fast, values)
    # degrees lost by Monte Carlo: squared deviations of levels with independent changes
    X, true = np.array(rows)[:, :, 0], rng.standard_normal((20000, 8))
    level = X @ values
    hat = X @ np.linalg.pinv(X)
    left = (true * level - (true * level) @ hat) / level
    assert 8 - lost == pytest.approx(np.mean(np.sum(left * true, axis=1)), rel=0.02)


def test_levels_without_scatter_have_finite_intervals() -> None:
    end = 60.0 * np.arange(1, 5)
    past = History(end, np.full((len(end), 1), 0.3), 0.0)
    states = states_at(past, 0, end)
    for deviations in (np.zeros(4), states[:, 4] - states[:, 4].mean()):
        found = Exposure.compute(states, deviations, 2)
        assert np.isfinite(found.level_along(past, 0, end)[1]).all()


def test_files_of_earlier_versions_cover_no_motion_to_another_warmth() -> None:
    stated = {"states": [0.1] * len(COURSES), "widest": 0.3, "scatter": 0.02, "slope": 0.4}
    found = Exposure.model_validate(stated)
    past = History(np.array([60.0, 120.0]), np.full((2, 1), 0.9), 0.0)
    assert not found.covers(past, 0)


def test_the_state_of_an_axis_is_cold_where_its_history_begins() -> None:
    past = History(np.array([100.0]), np.array([[0.5]]), 0.0)
    assert states_at(past, 0, np.array([0.0])) == pytest.approx(0.0)
    assert (states_at(past, 0, np.array([100.0])) > 0.05).all()


def test_a_law_without_exposure_keeps_its_wander() -> None:
    term = TermValue(value=1.0, standard_error=0.0)
    plain = dict.fromkeys(("offset", "Coulomb", "viscous"), term)
    own = AxisLaw(law="Coulomb", speed=1.0, terms=plain, plain=plain, held_out={}, wander=0.07)
    assert float(own.deviation(None)) == 0.07
