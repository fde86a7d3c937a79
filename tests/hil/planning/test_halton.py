"""Halton's sequence equals that of scipy, point by point."""

import pytest
from scipy.stats import qmc

from hil.planning.halton import halton


@pytest.mark.parametrize("dimensions", [1, 6, 21])
def test_the_points_are_those_of_scipy_without_the_first(dimensions: int) -> None:
    theirs = qmc.Halton(dimensions, scramble=False).random(301)[1:]
    assert (halton(300, dimensions) == theirs).all()
