"""Arrays of NumPy by what they hold, as annotations name them, and columns as they are filtered.

Shapes stand in docstrings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Mask = NDArray[np.bool_]
"""Whether something holds, element by element."""
Indices = NDArray[np.intp]
"""Places in another array, as NumPy finds them."""
Integers = NDArray[np.int64]
"""Whole numbers: rows of a file, or what compiled code counts by."""
Numbers = NDArray[np.int16]
"""Numbers of strokes and groups, as recordings hold them."""


def side_by_side(*parts: Array) -> Array:
    """Columns of several arrays, shape (n, k) or (n,), each column in one piece of memory.

    What goes on in time goes fastest so: filters, and sums over samples.
    """
    return np.vstack([part.T for part in parts]).T
