"""Types of NumPy arrays for annotations, and arrays of contiguous columns for filters.

Docstrings state the shapes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Mask = NDArray[np.bool_]
"""Boolean mask."""
Indices = NDArray[np.intp]
"""Indices into another array, of NumPy's type."""
Integers = NDArray[np.int64]
"""Whole numbers: rows of a file, or counts for compiled code."""
Numbers = NDArray[np.int16]
"""Numbers of strokes and groups, in the type of recordings."""


def side_by_side(*parts: Array) -> Array:
    """Stack columns of arrays, shape (n, k) or (n,), each column contiguous in memory.

    Contiguous columns are fastest for operations along time: filters, and sums over samples.
    """
    return np.vstack([part.T for part in parts]).T
