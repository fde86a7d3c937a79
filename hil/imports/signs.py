"""Torques that a drive states as numbers without sign: sign and magnitude, or two's complement.

Of numbers up to 2 S a negative one, -x, is S + x as sign and magnitude, and 2 S - x in two's
complement. Either makes a torque that passes zero jump by S or more; read as it was meant, it does
not. So the reading decides that leaves the least of the squared steps, if it leaves far less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array

LEAVES = 0.5
"""Share of the squared steps that the right reading leaves at most, of the plain one's and of the
other's: a step through zero is of S or 2 S in these, and of as much as friction in the right."""
LEAST, JUMPS = 64.0, 3
"""Numbers above which a bit can be a sign, and jumps that are no chance."""


def could_lack_signs(x: Array) -> bool:
    """Return True for whole numbers of which none is negative."""
    x = x[np.isfinite(x)]
    return bool(np.all(x >= 0) and np.all(x == np.floor(x)))


def signed(x: Array) -> tuple[Array, str] | None:
    """Return the numbers with their signs, and words for what they were; None where they have them.

    Parameters
    ----------
    x : array (n,)
        Torques as they were recorded, NaN where missing.
    """
    present = np.isfinite(x)
    most = float(np.max(x[present], initial=0.0))
    if most < LEAST or not could_lack_signs(x):
        return None
    half = 2.0 ** np.floor(np.log2(most))
    if np.count_nonzero(np.abs(np.diff(x[present])) > half / 2) < JUMPS:
        return None
    readings = {
        "as they are": x,
        "sign and magnitude": np.where(x < half, x, half - x),
        "two's complement": np.where(x < half, x, x - 2 * half),
    }
    steps = {words: float(np.sum(np.diff(y[present]) ** 2)) for words, y in readings.items()}
    best, second = sorted(steps, key=lambda words: steps[words])[:2]
    if best == "as they are" or steps[best] > LEAVES * steps[second]:
        return None
    return readings[best], f"{best}: from {half:.0f} on they are negative"
