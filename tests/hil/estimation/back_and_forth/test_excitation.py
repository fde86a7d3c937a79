"""Identifiable unknowns of normal equations, and the combinations they represent."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.estimation.back_and_forth.solution import excitation

MANY = 1e12
"""Sum of squares of torques far above the noise."""


def columns(seed: int, n: int = 5, decades: float = 3.0) -> np.ndarray:
    """Return columns whose magnitudes span up to twice `decades`."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((50, n)) * 10.0 ** rng.uniform(-decades, decades, n)


@given(st.integers(0, 1000))
def test_independent_columns_are_all_kept_as_they_are(seed: int) -> None:
    W = columns(seed)
    found = excitation(W.T @ W, 4, MANY)
    np.testing.assert_array_equal(found.combination, np.eye(4))


@given(st.integers(0, 1000), st.floats(-5.0, 5.0).filter(lambda share: abs(share) > 0.1))
def test_a_combination_is_kept_out_and_the_kept_stand_for_its_share(
    seed: int, share: float
) -> None:
    # squares of columns 1e4 times as large hold the sum of both up to rounding only
    W = columns(seed, decades=1.5)
    W[:, 3] = share * W[:, 1] + W[:, 0]
    found = excitation(W.T @ W, 4, MANY)
    assert len(found.kept) == 3
    p = np.array([1.0, -2.0, 3.0, 0.5])
    torque = W[:, :4] @ p
    # parts below a thousandth of a column are omitted from the combination
    tolerance = 5e-3 * float(abs(W[:, :4] * p).max())
    np.testing.assert_allclose(W[:, :4] @ (found.combination @ p), torque, atol=tolerance)
    np.testing.assert_array_equal((found.combination @ p)[found.lost], 0.0)


@pytest.mark.parametrize("times", [1.8e7, 1e5, 30.0])
def test_of_parameters_that_look_alike_the_one_that_shows_is_kept(times: float) -> None:
    """Keep p30, not p30 + 1.8e7 p35, whose value is no mass moment of any body."""
    W = columns(3)
    W[:, 2] = W[:, 0] / times
    found = excitation(W.T @ W, 4, MANY)
    assert list(found.lost) == [2]
    assert abs(found.combination[0, 2]) <= 1.0 / times * (1 + 1e-6)


def test_a_parameter_that_would_stand_for_one_that_is_not_kept_is_not_either() -> None:
    """The difference of two equal columns is lost in noise; a tiny third column depends on it."""
    W = columns(4)
    difference = 1e-3 * np.linspace(-1.0, 1.0, 50) * W[:, 1]
    W[:, 3] = W[:, 1] + difference
    W[:, 2] = 1e-5 * difference
    found = excitation(W.T @ W, 4, 1e8)
    assert list(found.kept) in ([0, 1], [0, 3])
    assert np.abs(found.combination).max() < 10.0


def test_what_nuisance_explains_is_not_kept() -> None:
    W = columns(1)
    W[:, 2] = 3.0 * W[:, 4]
    found = excitation(W.T @ W, 4, MANY)
    assert list(found.lost) == [2]


def test_what_noise_would_decide_is_not_kept() -> None:
    """A column whose difference from another one is below the resolution of the torque."""
    W = columns(2)
    W[:, 3] = W[:, 1] * (1.0 + 1e-3 * np.linspace(-1.0, 1.0, 50))
    assert len(excitation(W.T @ W, 4, MANY).kept) == 4
    assert len(excitation(W.T @ W, 4, 1e8).kept) == 3
