"""Jackknife, sandwich and classical covariance agree in cases where they must."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.least_squares.solving import fitted, inverse, solved
from hil.least_squares.uncertainty import (
    bias_reduced,
    classical,
    correlation_of,
    effective_degrees,
    jackknife,
    leave_one_out,
    sandwich,
    scatter,
    shrunk,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

samples = st.lists(st.floats(-100, 100).map(lambda x: round(x, 3)), min_size=3, max_size=30)


@given(samples)
def test_the_jackknife_of_a_mean_is_s_over_root_n(values: list[float]) -> None:
    y = np.array(values)
    without = np.array([[np.delete(y, k).mean()] for k in range(len(y))])
    error = np.sqrt(jackknife(without - y.mean())[0, 0])
    assert error == pytest.approx(y.std(ddof=1) / np.sqrt(len(y)), rel=1e-9, abs=1e-9)


@given(samples)
def test_the_sandwich_of_a_mean_is_s_over_root_n_too(values: list[float]) -> None:
    y = np.array(values)
    scores = (y - y.mean())[:, np.newaxis]
    N = np.array([[float(len(y))]])
    error = np.sqrt(sandwich(inverse(N), scatter(scores, few=True))[0, 0])
    assert error == pytest.approx(y.std(ddof=1) / np.sqrt(len(y)), rel=1e-9, abs=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(3, 12), st.integers(1, 4))
def test_leaving_out_by_shares_is_solving_again_without_the_rows(
    seed: int, n_measurements: int, n: int
) -> None:
    random = np.random.default_rng(seed)
    W = random.normal(size=(n_measurements, n + 3, n)) * 10.0 ** random.uniform(-3, 3, n)
    y = random.normal(size=(n_measurements, n + 3))
    found = leave_one_out(np.einsum("kmi,kmj->kij", W, W), np.einsum("kmi,km->ki", W, y))
    x = fitted(W.reshape(-1, n), y.ravel())
    kept = [np.arange(n_measurements) != k for k in range(n_measurements)]
    changes = np.array([fitted(W[k].reshape(-1, n), y[k].ravel()) - x for k in kept])
    length = np.linalg.norm(W.reshape(-1, n), axis=0)
    np.testing.assert_allclose(length * found.x, length * x, atol=1e-8)
    np.testing.assert_allclose(
        np.outer(length, length) * found.covariance,
        np.outer(length, length) * jackknife(changes),
        rtol=1e-6, atol=1e-8,
    )  # fmt: skip


def test_equal_measurements_give_as_many_degrees_as_there_are_less_one() -> None:
    shares = np.repeat(np.array([[[2.0, 0.5], [0.5, 1.0]]]), 9, axis=0)
    found = leave_one_out(shares, np.arange(18.0).reshape(9, 2))
    np.testing.assert_allclose(found.degrees_of_freedom, 8.0)


def test_one_measurement_that_carries_an_unknown_leaves_the_fewest_degrees() -> None:
    shares = np.zeros((9, 2))
    shares[:, 0], shares[3, 1] = 1.0, 1.0
    np.testing.assert_allclose(effective_degrees(shares, 2.0), [8.0, 2.0])


def test_the_bias_reduced_covariance_of_white_noise_is_right_on_average_however_few() -> None:
    random = np.random.default_rng(3)
    W = random.normal(size=(5, 4, 3)) * np.array([1.0, 100.0, 0.01])
    S, N = np.einsum("kmi,kmj->kij", W, W), np.einsum("kmi,kmj->ij", W, W)
    # a covariance is quadratic in the noise: its mean is the sum over noise in single samples
    large = 1e6 * np.eye(20).reshape(20, 5, 4)
    mean, left_out = (
        sum(of(S, np.einsum("kmi,km->ki", W, y)).covariance for y in large) / 1e12
        for of in (bias_reduced, leave_one_out)
    )
    variances = np.diag(inverse(N))
    np.testing.assert_allclose(np.diag(mean), variances, rtol=1e-6)
    assert np.all(np.diag(left_out) > 1.1 * variances)


def test_what_one_measurement_alone_shows_is_as_uncertain_as_its_noise() -> None:
    shares = np.array([np.diag([4.0, 0.0]), np.diag([0.0, 1.0]), np.diag([0.0, 1.0])])
    found = bias_reduced(shares, np.array([[8.0, 0.0], [0.0, 1.0], [0.0, 5.0]]))
    np.testing.assert_allclose(found.x, [2.0, 3.0])
    np.testing.assert_allclose(np.diag(found.covariance), [0.25, 4.0])
    np.testing.assert_allclose(found.degrees_of_freedom, 1.0)


def test_the_sandwich_reduces_to_the_classical_covariance_for_white_noise() -> None:
    random = np.random.default_rng(5)
    W = random.normal(size=(40000, 3)) * [1.0, 10.0, 0.1]
    e = 0.7 * random.normal(size=40000)
    N = W.T @ W
    scores = (W * e[:, np.newaxis]).reshape(400, 100, 3).sum(axis=1)
    exact = sandwich(inverse(N), 0.49 * N)
    np.testing.assert_allclose(exact, classical(W, 0.49), rtol=1e-9)
    error = np.sqrt(np.diag(sandwich(inverse(N), scatter(scores))))
    np.testing.assert_allclose(error, np.sqrt(np.diag(exact)), rtol=0.15)


def test_noise_alike_within_a_measurement_widens_the_sandwich_not_the_classical_one() -> None:
    random = np.random.default_rng(6)
    W = np.ones((2000, 1))
    e = np.repeat(random.normal(size=200), 10)
    scores = (W[:, 0] * e).reshape(200, 10).sum(axis=1)[:, np.newaxis]
    wide = sandwich(inverse(W.T @ W), scatter(scores))[0, 0]
    assert wide == pytest.approx(10.0 * classical(W, float(np.mean(e**2)))[0, 0])


def test_few_measurements_have_their_mean_score_taken_off_and_a_larger_scatter() -> None:
    scores = np.array([[1.0], [2.0], [6.0]])
    np.testing.assert_allclose(scatter(scores), [[41.0]])
    np.testing.assert_allclose(scatter(scores, few=True), [[21.0]])


def test_what_is_not_determined_is_infinitely_uncertain_and_correlated_with_nothing() -> None:
    t = np.linspace(0.0, 1.0, 20)
    covariance = classical(np.column_stack([t, np.ones(20), 2.0 * t, 0.0 * t]), 1.0)
    np.testing.assert_array_equal(np.isinf(np.diag(covariance)), [True, False, True, True])
    found = correlation_of(covariance)
    assert np.isfinite(found).all()
    np.testing.assert_allclose(np.diag(found), [0.0, 1.0, 0.0, 0.0])


@given(st.integers(0, 2**32 - 1))
def test_correlations_do_not_depend_on_units(seed: int) -> None:
    random = np.random.default_rng(seed)
    half = random.normal(size=(4, 8))
    units = 10.0 ** random.uniform(-3, 3, 4)
    covariance = half @ half.T
    found = correlation_of(covariance * np.outer(units, units))
    np.testing.assert_allclose(found, correlation_of(covariance), rtol=1e-9)
    np.testing.assert_allclose(np.diag(found), 1.0)


def test_the_solution_without_a_measurement_follows_from_its_score() -> None:
    random = np.random.default_rng(8)
    halves = random.normal(size=(6, 5, 3))
    shares, sides = halves.transpose(0, 2, 1) @ halves, random.normal(size=(6, 3))
    found = leave_one_out(shares, sides)
    without = solved(shares[1:].sum(axis=0), sides[1:].sum(axis=0))
    first = solved(shares[1:].sum(axis=0), shares[0] @ found.x - sides[0])
    np.testing.assert_allclose(without - found.x, first, rtol=1e-8)


def test_a_change_within_the_errors_of_a_weak_combination_is_none() -> None:
    """Two columns of length 100 are alike but for a hundred-thousandth."""
    rng = np.random.default_rng(3)
    z = rng.standard_normal(10_000)
    Z = np.stack([z, z + 1e-5 * rng.standard_normal(10_000)], axis=1)
    root = np.linalg.inv(np.linalg.cholesky(Z.T @ Z)).T
    sum_of_both, difference = np.array([1.0, 1.0]), np.array([1.0, -1.0])
    found = shrunk(0.1 * sum_of_both + 60.0 * difference, root, square=0.2**2 * float(z @ z))
    np.testing.assert_allclose(found, 0.1 * sum_of_both, atol=0.02)
