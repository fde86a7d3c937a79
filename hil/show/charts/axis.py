"""Axis of a chart: range, positions of values, and marks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.show.charts.chart import Band, Line, Points, Rule
from hil.show.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.show.charts.chart import Item, Range


STEPS = (1.0, 2.0, 2.5, 5.0)


@dataclass(frozen=True, slots=True)
class Scale:
    """Map from values `low` to `high` to lengths `begin` to `end`."""

    low: float
    high: float
    begin: float
    end: float
    decades: bool = False

    def place(self, values: ArrayLike) -> Array:
        """Compute the positions of values."""
        low, high, at = self.low, self.high, np.asarray(values, dtype=float)
        if self.decades:
            low, high, at = np.log10(low), np.log10(high), np.log10(at)
        found: Array = self.begin + (at - low) / (high - low) * (self.end - self.begin)
        return found

    def marks(self, most: int, *, whole: bool = False) -> dict[float, str]:
        """Return at most `most` round values with labels."""
        if self.decades:
            return _decades(self.low, self.high)
        step, first, last = self._multiples(most, 1.0 if whole else 0.0)
        digits = _digits(step)
        return {k * step: signed(f"{k * step:.{digits}f}") for k in range(first, last + 1)}

    def _multiples(self, most: int, least: float) -> tuple[float, int, int]:
        """Find the finest round step with up to `most` multiples, and the multiples' ends."""
        size = 10.0 ** (np.floor(np.log10((self.high - self.low) / max(most, 1))) - 1)
        for step in (each * 10**k * size for k in range(4) for each in STEPS):
            first = int(np.ceil(self.low / step - 1e-9))
            last = int(np.floor(self.high / step + 1e-9))
            if last - first < most and step >= least:
                break
        return float(step), first, last


def _digits(step: float) -> int:
    """Return the decimals needed for multiples of `step`."""
    return next((n for n in range(12) if abs(step * 10**n - round(step * 10**n)) < 1e-6), 12)


def _decades(low: float, high: float) -> dict[float, str]:
    exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    few = np.log10(high / low) < 1.5
    each = (d * 10.0**e for e in exponents for d in ((1, 2, 5) if few else (1,)))
    return {value: f"{value:g}" for value in each if low <= value <= high}


def axis_range(items: Sequence[Item], wanted: Range | None, *, along: bool, decades: bool) -> Range:
    """Return the range of an axis: `wanted`, or the extent of `items` with margins of 5 %."""
    if wanted is not None:
        return wanted
    values = np.concatenate([np.ravel(each) for each in _extents(items, along)] or [np.zeros(1)])
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if decades:
        factor = (high / low) ** 0.05 if high > low else 2.0
        return low / factor, high * factor
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def _extents(items: Sequence[Item], along: bool) -> Iterator[Array]:
    for item in items:
        if isinstance(item, Rule) and item.upright == along:
            yield np.array([item.at])
        elif isinstance(item, Band):
            yield from map(np.asarray, (item.x,) if along else (item.low, item.high))
        elif isinstance(item, Line | Points):
            values = np.asarray(item.x if along else item.y, dtype=float)
            yield values
            if isinstance(item, Points) and item.error is not None and item.along == along:
                error = np.nan_to_num(np.asarray(item.error, dtype=float))
                yield values - error
                yield values + error


def text_of(marks: Mapping[float, str], axis: Scale) -> list[tuple[float, str]]:
    """Return positions and labels of marks on an axis."""
    places = axis.place(list(marks)).tolist() if marks else []
    return list(zip(places, marks.values(), strict=True))
