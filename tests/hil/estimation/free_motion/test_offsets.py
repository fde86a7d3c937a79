"""An offset of friction that passes for weight is taken as usual; others are left alone."""

from __future__ import annotations

import numpy as np
import pytest

from hil.estimation.free_motion.friction_terms import COLUMNS
from hil.estimation.free_motion.offsets import ASYMMETRY, with_usual_offsets

OFFSET, COULOMB = 1 + COLUMNS.index("offset"), 1 + COLUMNS.index("Coulomb")
G = 9.81
FRICTION = 20.0


def unknowns(error: float, own: float) -> tuple[np.ndarray, np.ndarray]:
    """One mass and the friction of its axis: both off by `error` [N], the offset by `own` more."""
    x = np.zeros(1 + len(COLUMNS))
    x[0], x[OFFSET], x[COULOMB] = 8.0 - error / G, error, FRICTION
    V = np.zeros((len(x), len(x)))
    along = np.zeros(len(x))
    along[0], along[OFFSET] = -1.0 / G, 1.0
    V += 4.0 * np.outer(along, along)
    V[OFFSET, OFFSET] += own**2
    return x, V


def test_weight_is_freed_of_an_offset_beyond_what_is_usual() -> None:
    x, V = unknowns(error=12.0, own=0.01)
    found, covariance, axes = with_usual_offsets(x, V, 1, 1)
    assert abs(found[0] - 8.0) < 0.2 * abs(x[0] - 8.0)
    # what is left is what such an offset amounts to
    assert np.sqrt(covariance[0, 0]) == pytest.approx(ASYMMETRY * FRICTION / G, rel=0.1)
    assert abs(found[0] - 8.0) < 2 * np.sqrt(covariance[0, 0])
    assert axes == []


def test_an_axis_whose_offset_was_much_less_certain_is_named() -> None:
    x, V = unknowns(error=0.5, own=0.01)
    _, covariance, axes = with_usual_offsets(x, 10 * V, 1, 1)
    assert axes == [0]
    assert covariance[0, 0] < 0.5 * 10 * V[0, 0]


def test_an_offset_that_the_motion_shows_by_itself_is_left_as_it_is() -> None:
    x, V = unknowns(error=12.0, own=3.0)
    found, covariance, axes = with_usual_offsets(x, V, 1, 1)
    assert found == pytest.approx(x)
    assert covariance == pytest.approx(V)
    assert axes == []


def test_covariances_stay_positive_semidefinite() -> None:
    x, V = unknowns(error=12.0, own=0.1)
    _, covariance, _ = with_usual_offsets(x, V, 1, 1)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9
