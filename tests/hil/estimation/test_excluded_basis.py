"""The basis of the estimated columns, stored by channel, equals the basis written out."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from hil.estimation.excluded.basis import Basis
from hil.estimation.excluded.dispersion import LEVERAGE, freedom
from hil.least_squares.layout import axis_place
from hil.least_squares.solving import inverse_root

N_SHARED, N_OWN, N_CHANNELS = 3, 2, 3
EDGES = (0, 9, 30, 34, 60)


@pytest.mark.parametrize("dependent", [False, True])
def test_products_are_those_of_the_whole_basis(*, dependent: bool) -> None:
    """Groups have one channel, several, fewer rows than columns, or all rows of a channel."""
    rng = np.random.default_rng(1)
    channel = np.repeat([0, 1, 2, 0, 1], [9, 11, 10, 4, 26])
    rows = rng.standard_normal((len(channel), N_SHARED + N_OWN))
    if dependent:
        rows[:, 1] = 2.0 * rows[:, 0]
    places = [axis_place(N_SHARED, N_OWN, k) for k in range(N_CHANNELS)]
    Z = np.zeros((len(rows), N_SHARED + N_CHANNELS * N_OWN))
    for row, values, k in zip(Z, rows, channel, strict=True):
        row[places[k]] = values
    C = inverse_root(Z.T @ Z)
    Q, basis = Z @ C, Basis(rows, channel, np.array(EDGES[:-1]), places, C)
    x = rng.standard_normal((len(rows), 4))
    assert basis.project_out(x) == pytest.approx(x - Q @ (Q.T @ x), abs=1e-12)
    assert basis.project_out(x[:, 0]) == pytest.approx(basis.project_out(x)[:, 0], abs=1e-12)
    assert Z @ basis.unknowns(x) == pytest.approx(Q @ (Q.T @ x), abs=1e-12)
    assert basis.some(channel == 1) == pytest.approx(Q[channel == 1], abs=1e-12)
    enlarged = basis.enlarge(x[:, 0])
    for first, end in pairwise(EDGES):
        at = slice(first, end)
        values, vectors = np.linalg.eigh(np.eye(end - first) - Q[at] @ Q[at].T)
        root = vectors / np.sqrt(np.maximum(values, LEVERAGE)) @ vectors.T
        assert enlarged[at] == pytest.approx(root @ x[at, 0], rel=1e-9, abs=1e-9)


def test_a_single_column_has_exactly_one_degree_of_freedom() -> None:
    """Limits round degrees of freedom down: one less for rounding errors would double some."""
    squares = np.random.default_rng(2).random((200, 1, 1))
    assert {freedom(each) for each in squares} == {1.0}
