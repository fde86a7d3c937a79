"""Times from one column, from the sum of two, or from a rate.

A double has but 0.2 us of a date in seconds and 0.1 us of one in nanoseconds. So what the first row
states is subtracted from each column before the two are added, and the sum is exact to 1 ns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.tables import STAMP_UNITS
from hil.imports.units import SECONDS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.imports.map_file import MapFile
    from hil.imports.units import TimeUnit


EPOCH = 1e8
"""Stamps beyond count from a date, not from the recording's begin [s]."""


class TimeColumns:
    """What makes times of the columns that a map names, or of a format's own.

    Attributes
    ----------
    n : int
        How many columns of time there are.
    """

    def __init__(self, the_map: MapFile) -> None:
        self._map, stated = the_map, the_map.content.time
        units: Sequence[TimeUnit] = STAMP_UNITS
        if stated is not None:
            units = (stated.unit,) if stated.plus is None else (stated.unit, stated.plus.unit)
        self._rate = None if stated is None else stated.rate
        self.n = 0 if self._rate is not None else len(units)
        self._units = np.array([SECONDS[unit] for unit in units])
        self._begin: Array | None = None

    @property
    def origin(self) -> float:
        """Stamp that times count from, once some were read [s]; 0 but for those of a date."""
        return 0.0 if self._begin is None else float(self._begin @ self._units)

    def of(self, columns: Array, row: int) -> Array:
        """Times from `origin` on [s], shape (n_rows,).

        Parameters
        ----------
        columns : array (n_rows, n)
        row : int
            Number of the first row within its file, from 0.

        Raises
        ------
        FileError
            The second column is no part of a unit of the first.
        """
        if self._rate is not None:
            return (row + np.arange(len(columns))) / self._rate
        if self.n > 1:
            self._refuse_too_great(columns[:, 1])
        if self._begin is None:
            whole = np.isfinite(columns).all(axis=1)
            first = columns[int(np.argmax(whole))]
            if whole.any():
                self._begin = first if abs(first @ self._units) > EPOCH else np.zeros(self.n)
        begin = np.zeros(self.n) if self._begin is None else self._begin
        return np.asarray((columns - begin) @ self._units)

    def _refuse_too_great(self, column: Array) -> None:
        """Refuse a second column with more in it than one unit of the first."""
        column = column[np.isfinite(column)]
        if not len(column):
            return
        low, high = column.min(), column.max()
        if low < 0 or high * self._units[1] >= self._units[0]:
            raise self._map.wrong(
                ("time", "plus"),
                f"has values from {low:.10g} to {high:.10g}, which must be at least 0 and below"
                f" {self._units[0] / self._units[1]:.10g}, one unit of column; correct unit or"
                " column, or leave plus out where it is a whole stamp",
            )
