"""Least-squares routines against numpy, against other units, against the joint fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.least_squares.solving import (
    eliminated,
    fitted,
    inverse,
    inverse_root,
    nuisance_elimination,
    orthonormal,
    shares_without_nuisance,
    solved,
    undetermined,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@st.composite
def problems(draw: st.DrawFn) -> tuple[Array, Array]:
    """Return W with singular values between 1 and 100, columns in units of 1e-3 to 1e3, and y."""
    n = draw(st.integers(2, 6))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = n + draw(st.integers(1, 20))
    left, _ = np.linalg.qr(random.normal(size=(rows, n)))
    right, _ = np.linalg.qr(random.normal(size=(n, n)))
    sizes = 10.0 ** random.uniform(0, 2, n)
    units = 10.0 ** random.uniform(-3, 3, n)
    return (left * sizes) @ right * units, random.normal(size=rows)


def close(found: Array, expected: Array, tolerance: float = 1e-8) -> None:
    """Compare relative to the largest number of `expected`."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def lstsq(W: Array, y: Array) -> Array:
    """Solve with columns of unit length, by numpy."""
    length = np.linalg.norm(W, axis=0)
    solution: Array = np.linalg.lstsq(W / length, y, rcond=None)[0] / length
    return solution


@given(problems())
def test_all_ways_to_solve_agree_with_numpy(problem: tuple[Array, Array]) -> None:
    W, y = problem
    expected, length = lstsq(W, y), np.linalg.norm(W, axis=0)
    N, v = W.T @ W, W.T @ y
    ways = (fitted(W, y), solved(N, v), inverse(N) @ v)
    for found in ways:
        close(length * found, length * expected)


@given(problems())
def test_several_right_hand_sides_are_solved_one_by_one(problem: tuple[Array, Array]) -> None:
    W, y = problem
    both = np.column_stack([y, y[::-1]])
    for solve, N, sides in ((fitted, W, both), (solved, W.T @ W, W.T @ both)):
        alone = np.column_stack([solve(N, side) for side in sides.T])
        np.testing.assert_allclose(solve(N, sides), alone, rtol=1e-8, atol=1e-12)


@given(problems(), st.integers(-9, 9), st.integers(0, 1))
def test_units_of_an_unknown_change_its_value_and_nothing_else(
    problem: tuple[Array, Array], power: int, place: int
) -> None:
    W, y = problem
    unit = np.ones(W.shape[1])
    unit[place] = 2.0**power
    other = W * unit
    length = np.linalg.norm(W, axis=0)
    for found, expected in (
        (fitted(other, y), fitted(W, y)),
        (solved(other.T @ other, other.T @ y), solved(W.T @ W, W.T @ y)),
    ):
        close(length * unit * found, length * expected, 1e-10)
    assert not undetermined(other.T @ other).any()


@given(problems())
def test_the_root_of_the_inverse_whitens_and_its_product_is_the_inverse(
    problem: tuple[Array, Array],
) -> None:
    W, _ = problem
    N = W.T @ W
    B = inverse_root(N)
    np.testing.assert_allclose(B.T @ N @ B, np.eye(len(N)), atol=1e-8)
    np.testing.assert_allclose(inverse(N) @ N @ B, B, rtol=1e-6, atol=1e-8 * np.abs(B).max())


@given(problems())
def test_orthonormal_columns_span_those_given(problem: tuple[Array, Array]) -> None:
    W, y = problem
    Q, B = orthonormal(W)
    np.testing.assert_allclose(Q.T @ Q, np.eye(W.shape[1]), atol=1e-10)
    np.testing.assert_allclose(W @ B, Q, atol=1e-10)
    np.testing.assert_allclose(Q @ (Q.T @ y), W @ fitted(W, y), atol=1e-8)


@given(problems(), st.integers(1, 5))
def test_with_nuisance_eliminated_the_others_solve_as_in_the_joint_problem(
    problem: tuple[Array, Array], n: int
) -> None:
    W, y = problem
    n = min(n, W.shape[1] - 1)
    length = np.linalg.norm(W, axis=0)[:n]
    expected = lstsq(W, y)[:n]
    N, v = W.T @ W, W.T @ y
    P = nuisance_elimination(N, n)
    close(length * solved((P @ N)[:, :n], P @ v), length * expected, 1e-7)
    stacked = np.column_stack([W[:, :n], y, W[:, n:]])
    product, rank = eliminated(stacked.T @ stacked, W.shape[1] - n)
    close(length * solved(product[:n, :n], product[:n, n]), length * expected, 1e-7)
    assert rank == W.shape[1] - n


@given(problems(), st.integers(1, 5))
def test_shares_without_nuisance_add_up_to_the_normal_equations_without_it(
    problem: tuple[Array, Array], n: int
) -> None:
    W, y = problem
    n = min(n, W.shape[1] - 1)
    rows = np.array_split(np.arange(len(y)), 3)
    N = np.array([W[k].T @ W[k] for k in rows])
    v = np.array([W[k].T @ y[k] for k in rows])
    shares, sides = shares_without_nuisance(N, v, n)
    length = np.linalg.norm(W, axis=0)[:n]
    close(length * solved(shares.sum(axis=0), sides.sum(axis=0)), length * lstsq(W, y)[:n], 1e-7)


@given(problems())
def test_a_column_that_says_nothing_stays_zero_and_disturbs_none(
    problem: tuple[Array, Array],
) -> None:
    W, y = problem
    with_silent = np.column_stack([W, np.zeros(len(W))])
    N, v = with_silent.T @ with_silent, with_silent.T @ y
    length = np.linalg.norm(W, axis=0)
    for found in (fitted(with_silent, y), solved(N, v), inverse(N) @ v):
        assert found[-1] == 0.0
        close(length * found[:-1], length * lstsq(W, y))
    np.testing.assert_array_equal(undetermined(N), [*[False] * W.shape[1], True])


def test_of_two_columns_that_are_alike_neither_is_determined_but_their_sum_is() -> None:
    t = np.linspace(0.0, 1.0, 50)
    W = np.column_stack([t, 3.0 * t, np.ones(50)])
    N = W.T @ W
    x = fitted(W, 6.0 * t + 1.0)
    np.testing.assert_allclose(W @ x, 6.0 * t + 1.0)
    # equal in relative terms: the minimum-norm scaled solution
    np.testing.assert_allclose(x, [3.0, 1.0, 1.0])
    np.testing.assert_array_equal(undetermined(N), [True, True, False])
    assert inverse_root(N).shape == orthonormal(W)[1].shape == (3, 2)


def test_what_elimination_leaves_of_rounding_is_small_against_the_size_it_had() -> None:
    W = np.column_stack([np.ones(30), np.linspace(0.0, 1.0, 30), np.full(30, 1e3)])
    N = W.T @ W
    P = nuisance_elimination(N, 2)
    left = (P @ N)[:, :2]
    np.testing.assert_array_equal(undetermined(left, 1e-9, np.diag(N)[:2]), [True, False])
