"""Regressions with common unknowns: group-correlated errors reduce the weight of a kind."""

from __future__ import annotations

import numpy as np
import pytest

from hil.least_squares.balance import Kind, Shares, balance
from hil.least_squares.blocks import Blocks
from hil.least_squares.regression import Regression

SHARED = ("p1", "p2")
TRUTH = np.array([3.0, -2.0])
SAMPLES = 50


def rows(
    rng: np.random.Generator, groups: int = 20, within: float = 0.0, noise: float = 0.1
) -> np.ndarray:
    """Return samples of groups with white noise, and one common error per group.

    Columns have the same sign within a group, so a common error passes for a parameter.
    """
    W = np.abs(rng.normal(size=(groups, SAMPLES, 2))) * rng.choice([-1, 1], size=(groups, 1, 2))
    y = W @ TRUTH + within * rng.normal(size=(groups, 1))
    y += noise * rng.normal(size=y.shape)
    return np.concatenate([y[..., np.newaxis], W, np.ones((groups, SAMPLES, 1))], axis=-1)


def blocks_of(rows: np.ndarray, name: str) -> Blocks:
    products = np.einsum("gni,gnj->gij", rows, rows)[:, np.newaxis]
    counts = np.full((len(rows), 1), float(rows.shape[1]))
    return Blocks(SHARED, ("offset",), products, counts, (name,))


def kind(rng: np.random.Generator, name: str, groups: int = 20, **errors: float) -> Regression:
    """Return the regression of one channel."""
    return Regression.weighed(blocks_of(rows(rng, groups, **errors), name))


def factors(parts: list[Regression]) -> np.ndarray:
    return Shares([Kind(part) for part in parts], SHARED).factors()


@pytest.fixture
def rng() -> np.random.Generator:
    """Generator with a fixed seed."""
    return np.random.default_rng(3)


def test_kinds_that_are_alike_count_alike(rng: np.random.Generator) -> None:
    """Both kinds have white noise and the same number of groups."""
    found = factors([kind(rng, "a", 200), kind(rng, "b", 200)])
    assert found[-1] == 1.0
    assert found[0] == pytest.approx(1.0, abs=0.4)


def test_what_repeats_within_groups_makes_a_kind_count_less(rng: np.random.Generator) -> None:
    """Residuals of both are similar; errors of the first do not average within a group."""
    repeats, white = kind(rng, "a", within=0.3, noise=0.01), kind(rng, "b", noise=0.3)
    assert factors([repeats, white])[0] < 0.2


def test_the_order_of_kinds_does_not_matter(rng: np.random.Generator) -> None:
    """The factor of a kind is relative to the other kind, so the exchange inverts the factor."""
    one, other = kind(rng, "a", within=0.2), kind(rng, "b")
    forth, back = factors([one, other]), factors([other, one])
    assert forth[0] == pytest.approx(1.0 / back[0], rel=1e-3)


def test_together_they_are_nearer_the_truth_than_each_alone() -> None:
    """Mean over forty draws of a kind with group-correlated errors and one without."""
    errors = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        parts = [kind(rng, "a", within=0.3, noise=0.01), kind(rng, "b", groups=6, noise=0.6)]
        both = balance([Kind(part) for part in parts], SHARED).whole.regression
        weighed = [each.solution[:2] for each in (*parts, both)]
        errors.append([np.linalg.norm(x - TRUTH) for x in weighed])
    first, second, together = np.sqrt(np.mean(np.square(errors), axis=0))
    assert together < min(first, second)


def test_each_kind_keeps_its_own_unknowns(rng: np.random.Generator) -> None:
    """Each channel has its own offset; the parameters are common."""
    both = balance([Kind(kind(rng, "a")), Kind(kind(rng, "b"))], SHARED).whole
    assert both.regression.layout.names == ("p1", "p2", "a offset", "b offset")
    assert both.cells is None


def test_all_is_the_sum_of_what_each_kind_alone_has(rng: np.random.Generator) -> None:
    """Contributions to the solutions, and to their known disturbances."""
    one, other, moved = kind(rng, "a"), kind(rng, "b"), np.array([[1.0], [0.0]])
    both, parts = balance([Kind(one, effect=moved), Kind(other)], SHARED)
    expected = parts[0] @ one.solution[:2] + parts[1] @ other.solution[:2]
    np.testing.assert_allclose(np.sum(parts, axis=0), np.eye(2), atol=1e-9)
    np.testing.assert_allclose(both.regression.solution[:2], expected, rtol=1e-9)
    np.testing.assert_allclose(both.effect, parts[0] @ moved)


def test_what_repeats_with_the_motion_makes_a_kind_count_less(rng: np.random.Generator) -> None:
    """Each group of time has all states, with the same error every time."""
    by_state = rows(rng, groups=6, within=0.3, noise=0.3)
    by_time = np.stack([by_state[:, k::10].reshape(-1, 4) for k in range(10)])
    one, other = Regression.weighed(blocks_of(by_time, "a")), Kind(kind(rng, "b", noise=0.3))
    cells = blocks_of(by_state, "a")
    hidden, shown = (
        Shares([first, other], SHARED).factors()[0] for first in (Kind(one), Kind(one, cells))
    )
    assert shown < hidden / 2


def test_what_no_group_shows_makes_a_kind_count_less_and_stays_in_the_covariance(
    rng: np.random.Generator,
) -> None:
    one, other = kind(rng, "a", 200), kind(rng, "b", 200)
    beside = 0.01**2 * np.eye(2)
    both = [Kind(one, beside=beside), Kind(other)]
    assert Shares(both, SHARED).factors()[0] < 0.7 * factors([one, other])[0]
    left = balance(both, SHARED).whole.beside
    assert (np.diag(left) > 0).all()
    assert (np.diag(left) < np.diag(beside)).all()


def test_a_kind_beside_which_the_other_is_worth_nothing_leaves_it_in_the_equations(
    rng: np.random.Generator,
) -> None:
    exact, poor = kind(rng, "a", noise=1e-9), kind(rng, "b", noise=1.0)
    forth, back = factors([exact, poor])[0], factors([poor, exact])[0]
    assert 1.0 <= forth <= 100.001
    assert 0.00999 <= back <= 1.0
