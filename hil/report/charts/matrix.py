"""A matrix of shares from -1 to 1: the colour of a cell is the sign, its strength the size."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.elements import number, text
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.report.charts.chart import Matrix

SCALE = 78.0
"""Height of the names of the columns and of the scale of colours below them."""
FEW = 20
"""Rows up to which there is room for figures."""
_STEP = 12.0
"""Width of a tenth of the scale."""


def matrix_in(
    matrix: Matrix, left: float, top: float, size: float, explanation: str
) -> Iterator[str]:
    """Draw a matrix into a square with its names around, and below it the scale of colours."""
    n = len(matrix.names)
    cell = size / n
    for i, name in enumerate(matrix.names):
        yield text(left - 5, top + (i + 0.65) * cell, name, "end")
        if n <= FEW:
            yield text(left + (i + 0.5) * cell, top + size + 13, name, "middle")
    for i, j in np.ndindex(n, n):
        value = float(matrix.values[i, j])
        x, y = left + j * cell, top + i * cell
        if abs(value) >= 0.005:
            yield _cell(x, y, cell, cell, value)
        if n <= FEW and i != j and abs(value) >= 0.05:
            yield text(x + cell / 2, y + 0.65 * cell, signed(f"{value:.1f}"), "cell")
    yield from _scale(left + size / 2, top + size + 26, explanation)


def _cell(x: float, y: float, width: float, height: float, value: float) -> str:
    sign = "plus" if value > 0 else "minus"
    size = f'width="{number(width)}" height="{number(height)}"'
    strength = f'fill-opacity="{0.85 * abs(value):.2f}"'
    return f'<rect class="{sign}" x="{number(x)}" y="{number(y)}" {size} {strength}/>'


def _scale(middle: float, top: float, explanation: str) -> Iterator[str]:
    for k in range(-10, 11):
        yield _cell(middle + (k - 0.5) * _STEP, top, _STEP, 9, k / 10)
    for value in (-1, -0.5, 0, 0.5, 1):
        yield text(middle + 10 * value * _STEP, top + 21, signed(f"{value:g}"), "middle")
    yield text(middle, top + 38, explanation, "middle")
