"""Torques recorded as numbers without sign: sign and magnitude, or two's complement.

In unsigned numbers below 2 S, a negative value -x is S + x as sign and magnitude, and 2 S - x in
two's complement. A wrong reading makes a torque jump by S or more at a zero crossing. Therefore the
reading with the least squared steps is taken, if its sum is far smaller than the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array

LEAVES = 0.5
"""Maximum ratio of the squared steps between samples: right interpretation over any other.

In a wrong interpretation, a zero crossing has a step of S or 2 S; in the right one, of the size of
friction.
"""
LEAST, JUMPS = 64.0, 3
"""Minimum value of a sign bit, and minimum number of jumps beyond chance."""


def could_lack_signs(x: Array) -> bool:
    """Return True for whole numbers without a negative number."""
    x = x[np.isfinite(x)]
    return bool(np.all(x >= 0) and np.all(x == np.floor(x)))


def signed(x: Array) -> tuple[Array, str] | None:
    """Return the numbers with signs and the coding in words; None if signs are not missing.

    Parameters
    ----------
    x : array (n,)
        Torques as recorded, NaN for missing ones.
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
    return readings[best], f"{best}: values from {half:.0f} on are negative"
