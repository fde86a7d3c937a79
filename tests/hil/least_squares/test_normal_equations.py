"""Normal equations of all unknowns from inner products of each axis, block by block."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from hil.least_squares.blocks import Blocks
from hil.least_squares.layout import axis_place, embedded
from hil.least_squares.normal_equations import Normal, reweighted, successive
from hil.least_squares.solving import fitted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

N_BLOCKS, N_AXES, N_SHARED, N_OWN, N_ROWS = 7, 2, 3, 2, 20
WEIGHTS = np.array([4.0, 0.25])


@pytest.fixture(scope="module")
def rows() -> Array:
    """Return torque and columns of each block and axis."""
    shape = N_BLOCKS, N_AXES, N_ROWS, 1 + N_SHARED + N_OWN
    return np.random.default_rng(0).standard_normal(shape)


@pytest.fixture(scope="module")
def products(rows: Array) -> Array:
    return np.swapaxes(rows, -1, -2) @ rows


def blocks(products: Array) -> Blocks:
    shared, own = (
        tuple(f"{kind} {k}" for k in range(n)) for kind, n in (("p", N_SHARED), ("f", N_OWN))
    )
    return Blocks(shared, own, products, np.full((N_BLOCKS, N_AXES), float(N_ROWS)))


def stacked(rows: Array) -> tuple[Array, Array]:
    """Return weighted columns of all unknowns and torque, axis by axis."""
    W = np.zeros((*rows.shape[:3], N_SHARED + N_AXES * N_OWN))
    for axis, weight in enumerate(WEIGHTS):
        place = axis_place(N_SHARED, N_OWN, axis)
        W[:, axis, :, place] = np.moveaxis(np.sqrt(weight) * rows[:, axis, :, 1:], -1, 0)
    return W, np.sqrt(WEIGHTS)[:, np.newaxis] * rows[..., 0]


def test_the_solution_is_that_of_all_rows_stacked(rows: Array, products: Array) -> None:
    W, y = stacked(rows)
    system = blocks(products).normal(WEIGHTS)
    expected = fitted(W.reshape(-1, W.shape[-1]), y.ravel())
    assert system.solution() == pytest.approx(expected)
    assert system.grouped(3).solution() == pytest.approx(expected)
    assert system.grouped(100).solution() == pytest.approx(expected)


def test_errors_are_squares_of_what_rows_leave(rows: Array, products: Array) -> None:
    W, y = stacked(rows)
    x = np.arange(1.0, 8.0)
    left = (y - W @ x) ** 2
    assert blocks(products).normal(WEIGHTS).error(x) == pytest.approx(left.sum(axis=(1, 2)))
    assert blocks(products).mean_squares(x) == pytest.approx(left.mean(axis=(0, 2)) / WEIGHTS)


def test_scores_of_all_blocks_cancel_at_the_solution(products: Array) -> None:
    system = Normal.split(products[:, 0])
    scores = system.scores(system.solution())
    assert scores.sum(axis=0) == pytest.approx(0.0, abs=1e-9)
    doubled = system.weighted(np.full(N_BLOCKS, 2.0))
    assert doubled.solution() == pytest.approx(system.solution())


def test_unknowns_that_are_not_kept_are_zero(products: Array) -> None:
    system, kept = blocks(products).normal(WEIGHTS), np.array([0, 2, 5])
    found = system.solution(kept)
    assert found[kept] == pytest.approx(system.only(kept).solution())
    assert not np.delete(found, kept).any()
    square = embedded(np.ones((2, 2)), np.array([0, 2]), 3)
    assert square.tolist() == [[1.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]]


def test_weights_settle_or_end_with_the_rounds() -> None:
    calls = []

    def halfway(weights: Array) -> Array:
        calls.append(weights)
        return (weights + 3.0) / 2.0

    assert reweighted(halfway, np.array([1.0]), 100) == pytest.approx(3.0, rel=1e-5)
    assert len(calls) < 30
    assert reweighted(halfway, np.array([1.0]), 2).tolist() == [2.5]


def test_successive_parts_cover_all() -> None:
    found = successive(2, 12, 3)
    assert [each.start for each in found[1:]] == [each.stop for each in found[:-1]]
    assert (found[0].start, found[-1].stop) == (2, 12)
