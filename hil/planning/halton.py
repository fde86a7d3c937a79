"""Halton's low-discrepancy sequence: points that fill a unit cube evenly at any number of points.

Coordinate k of point i is the radical inverse of i: its digits in base of the k-th prime, mirrored
at the radix point (Halton, Numer. Math. 2 (1960) 84-90). The points are those of scipy.stats.qmc,
whose import alone takes longer than the design of a plan.
"""

from __future__ import annotations

import math
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array


GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
"""Step of the one-dimensional low-discrepancy sequence k GOLDEN mod 1."""


def halton(n: int, dimensions: int) -> Array:
    """Return points 1 to n of the sequence, shape (n, dimensions), coordinates within 0 ... 1."""
    points, primes = np.zeros((n, dimensions)), list[int]()
    for number in count(2):
        if len(primes) == dimensions:
            break
        if all(number % prime for prime in primes):
            primes.append(number)
    for k, base in enumerate(primes):
        share, left = 1.0 / base, np.arange(1, n + 1)
        while left.any():
            points[:, k] += left % base * share
            share /= base
            left //= base
    return points
