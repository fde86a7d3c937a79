"""Gear warmth as a state of friction: identified where data show it, never elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from hil.friction.warmth import REFERENCE, History, Warmth, find_warmth, warmth_at
from hil.least_squares.blocks import Blocks

WARMED, COOLED, SLOPE = 30.0, 180.0, -0.2
LAW = np.array([0.3, 40.0, 20.0])
TERMS = ("offset", "Coulomb", "viscous")


def course(n: int = 60, seed: int = 0) -> tuple[History, np.ndarray]:
    """Return the history of an axis that measures for 10 s each, with rests, and the times."""
    rests = np.random.default_rng(seed).choice([2.0, 20.0, 90.0, 300.0], n)
    ends = np.cumsum(np.column_stack([rests, np.full(n, 10.0)]).ravel())
    speeds = np.tile([0.0, REFERENCE], n)[:, np.newaxis]
    return History(ends, speeds, 0.0), ends[1::2] - 5.0


def levels(factors: np.ndarray, seed: int = 0) -> Blocks:
    """Return products of measurements with these friction levels, and torque noise."""
    rng, found = np.random.default_rng(seed), []
    for factor in factors:
        u = rng.uniform(0.1, 0.9) * np.repeat([1.0, -1.0], 50)
        columns = np.column_stack([np.ones_like(u), np.sign(u), u])
        y = columns @ (LAW * [1.0, factor, factor]) + 0.3 * rng.standard_normal(len(u))
        both = np.column_stack([y, columns])
        found.append(both.T @ both)
    return Blocks((), TERMS, np.array(found)[:, np.newaxis], np.full((len(found), 1), 100.0))


def warm_levels(wander: float, seed: int = 0) -> tuple[Blocks, np.ndarray, History]:
    past, time = course(seed=seed)
    warmth = warmth_at(past, 0, WARMED, COOLED, time)
    chance = wander * np.random.default_rng(seed).standard_normal(len(time))
    return levels(1 + SLOPE * (warmth - warmth.mean()) + chance, seed), time, past


def walking_levels(seed: int) -> tuple[Blocks, np.ndarray, History]:
    past, time = course(seed=seed)
    steps = np.random.default_rng(100 + seed).standard_normal(len(time))
    walk = 0.03 * np.cumsum(steps * np.sqrt(np.diff(time, prepend=0.0) / 600.0))
    return levels(1 + walk - walk.mean(), seed), time, past


def test_a_warmth_that_made_the_levels_is_found() -> None:
    found = find_warmth(*warm_levels(0.005), axis=0)
    assert found is not None
    own = found.warmth
    assert (own.warming, own.cooling) == (WARMED, COOLED)
    assert own.slope == pytest.approx(SLOPE, abs=4 * own.slope_error)
    assert found.values == pytest.approx(LAW, rel=0.02, abs=0.1)
    assert own.cold > 1 > own.warm
    assert own.wander < 0.02
    assert min(own.over_law, own.over_last) > 1


def test_of_levels_that_walk_by_chance_no_warmth_is_claimed() -> None:
    assert not any(find_warmth(*walking_levels(seed), axis=0) for seed in range(8))


def test_an_axis_that_always_did_the_same_has_no_warmth() -> None:
    past, time = course()
    still = History(past.end, 0 * past.speed, 0.0)
    assert find_warmth(levels(np.ones(len(time))), time, still, axis=0) is None


def test_friction_that_rises_with_motion_is_no_warmth() -> None:
    past, time = course()
    warmth = warmth_at(past, 0, WARMED, COOLED, time)
    assert find_warmth(levels(1 + 0.2 * warmth), time, past, axis=0) is None


def test_warmth_rises_in_motion_and_falls_at_rest() -> None:
    past = History(np.array([1000.0, 1180.0]), np.array([[REFERENCE], [0.0]]), 0.0)
    steady = (1 / WARMED) / (1 / WARMED + 1 / COOLED)
    found = warmth_at(past, 0, WARMED, COOLED, np.array([0.0, 1000.0, 1180.0]))
    assert found == pytest.approx([0.0, steady, steady / np.e])


def test_beyond_what_was_seen_friction_is_that_of_the_nearest_warmth() -> None:
    own = Warmth(
        warming=10.0, cooling=60.0, slope=-0.3, slope_error=0.01, reference=0.4,
        seen=(0.2, 0.6), wander=0.02, over_law=1.2, over_last=1.3,
    )  # fmt: skip
    assert own.factor([0.0, 0.4, 1.0]) == pytest.approx([own.cold, 1.0, own.warm])
    assert own.deviation(0.4) == pytest.approx(0.02)
    assert own.deviation(0.6) > 0.02 * own.warm
