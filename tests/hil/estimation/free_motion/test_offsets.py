"""An unusual friction offset that resembles weight makes both doubtful."""

from __future__ import annotations

import numpy as np
import pytest

from hil.estimation.free_motion.offsets import ASYMMETRY, enlarge_covariance
from hil.friction.terms import COLUMNS
from hil.least_squares.layout import Layout, axis_names

OFFSET, COULOMB = 1 + COLUMNS.index("offset"), 1 + COLUMNS.index("Coulomb")
G = 9.81
FRICTION = 20.0
LAYOUT = Layout(("p1",), COLUMNS, axis_names(1))
DEGREES = np.full(1 + len(COLUMNS), 8.0)


def unknowns(error: float, own: float) -> tuple[np.ndarray, np.ndarray]:
    """Return one mass and its axis's friction, both off by `error` [N],
    the offset by `own` in addition.
    """
    x = np.zeros(1 + len(COLUMNS))
    x[0], x[OFFSET], x[COULOMB] = 8.0 - error / G, error, FRICTION
    along = np.zeros(len(x))
    along[0], along[OFFSET] = -1.0 / G, 1.0
    V = 4.0 * np.outer(along, along)
    V[OFFSET, OFFSET] += own**2
    return x, V


def test_weight_is_as_uncertain_as_an_unusual_offset() -> None:
    x, V = unknowns(error=12.0, own=0.01)
    covariance, axes = enlarge_covariance(x, V, V, LAYOUT, DEGREES)
    assert axes == [0]
    unusual = np.sqrt(12.0**2 - (ASYMMETRY * FRICTION) ** 2)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(unusual / G, rel=1e-3)
    assert abs(x[0] - 8.0) < 1.96 * np.sqrt(covariance[0, 0])


def test_an_offset_with_the_weight_of_a_rotor_may_have_any_size() -> None:
    x, V = unknowns(error=12.0, own=0.01)
    covariance, axes = enlarge_covariance(x, V, V, LAYOUT, DEGREES, free=(0,))
    assert covariance == pytest.approx(V)
    assert axes == []


def test_noise_is_no_unusual_offset() -> None:
    """With 8 degrees of freedom, 2.5 standard errors above 3 N are noise."""
    x, V = unknowns(error=8.0, own=0.01)
    covariance, axes = enlarge_covariance(x, V, V, LAYOUT, DEGREES)
    assert axes == []
    assert covariance[0, 0] > V[0, 0]


def test_a_usual_offset_is_no_reason_to_doubt() -> None:
    x, V = unknowns(error=0.5, own=0.01)
    covariance, axes = enlarge_covariance(x, V, V, LAYOUT, DEGREES)
    assert covariance == pytest.approx(V)
    assert axes == []


def test_an_offset_that_the_motion_shows_by_itself_is_no_reason_to_doubt() -> None:
    x, V = unknowns(error=12.0, own=3.0)
    covariance, axes = enlarge_covariance(x, V, V, LAYOUT, DEGREES)
    assert covariance == pytest.approx(V)
    assert axes == []
