"""Combinations of parameters whose columns are mostly noise of the positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from hil.estimation.free_motion.bias_test import Halves, noise_directions
from hil.least_squares.blocks import Blocks
from hil.least_squares.regression import Regression

if TYPE_CHECKING:
    from numpy.typing import NDArray

NOISE = 1e-3


def found(apart: float) -> NDArray[np.float64]:
    """Return the combinations for two columns that differ by `apart` and `NOISE`, beside an offset.

    The noise of the two halves of the samples is independent.
    """
    rng = np.random.default_rng(0)
    moved, other = rng.standard_normal((2, 4000))
    torque = 3.0 * moved + 0.1 * rng.standard_normal(4000)
    of_halves = [
        np.column_stack([
            torque, moved, moved + apart * other + NOISE * rng.standard_normal(4000), np.ones(4000)
        ])
        for _ in range(2)
    ]  # fmt: skip
    first, second = (each.reshape(10, 400, 4) for each in of_halves)
    count = np.full((10, 1), 400.0)

    def blocks(left: NDArray[np.float64]) -> Blocks:
        products = np.swapaxes(left, 1, 2) @ first
        return Blocks(("p1", "p2"), ("offset",), products[:, np.newaxis], count)

    plain = Regression.weighed(blocks(first))
    return noise_directions(Halves(plain, plain.transfer(blocks(second))), 2)


def test_a_combination_whose_column_is_noise_is_found() -> None:
    ((one,), (other,)) = found(0.3 * NOISE)
    assert other == pytest.approx(-one, rel=1e-2)


def test_a_combination_that_the_motion_shows_above_noise_is_none() -> None:
    assert found(3.0 * NOISE).shape == (2, 0)
