"""Numbers of a page, unpacked as by its script."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array


def unpacked(given: Any) -> Array:
    """Undo `hil.view.page.packed`; unknown numbers are NaN."""
    differences = np.array(given["differences"], dtype=float)
    sums = given["step"] * np.cumsum(np.nan_to_num(differences))
    return np.where(np.isnan(differences), np.nan, sums)
