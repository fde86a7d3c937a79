"""Numbers of registers, which lack signs or turns.

In unsigned numbers below 2 S, a negative value -x is S + x as sign and magnitude, and 2 S - x in
two's complement. A wrong reading makes a torque jump by S or more at a zero crossing. Therefore the
reading with the least squared steps is taken, if its sum is far smaller than the others. A value
that never changes sign never jumps: it is read as the same register of other joints.

The position of an encoder of one turn jumps by the turn P where the motion goes on, so its values
reach over one turn, and each jump is opposite to the motion before and after. At the seam of two
recordings the joint is at rest, and an outlier is over at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array

LEAVES = 0.5
"""Maximum ratio of the squared steps between samples: right interpretation over any other.

In a wrong interpretation, a zero crossing has a step of S or 2 S; in the right one, of the size of
friction.
"""
LEAST, JUMPS = 64.0, 3
"""Minimum value of a sign bit, and minimum number of jumps beyond chance."""
AROUND = 3
"""Samples before and after a jump that show the motion."""
AT_REST = 0.1
"""Share of the mean speed below which a joint is at rest: from there, a braking joint has a
hundredth of its way to go."""


def could_lack_signs(x: Array) -> bool:
    """Return True for whole numbers without a negative number."""
    x = x[np.isfinite(x)]
    return bool(np.all(x >= 0) and np.all(x == np.floor(x)))


@dataclass(frozen=True)
class Coding:
    """Coding of negative values in unsigned numbers below 2 `half`.

    Attributes
    ----------
    half : float
        Value of the sign bit.
    """

    name: str
    half: float

    def __str__(self) -> str:
        return f"{self.name}: values from {self.half:.0f} on are negative"

    def decode(self, x: Array) -> Array:
        """Return numbers with signs."""
        negative = self.half - x if self.name == MAGNITUDE else x - 2 * self.half
        return np.where(x < self.half, x, negative)

    def is_shared(self, x: Array) -> bool:
        """Return True for numbers that the register of another joint could hold too."""
        x = x[np.isfinite(x)]
        fits = self.half <= np.max(x, initial=0.0) < 2 * self.half
        return bool(fits) and _roughness(self.decode(x)) <= _roughness(x)


MAGNITUDE, COMPLEMENT = "sign and magnitude", "two's complement"


def coding_of(x: Array, *, jumps: bool = True) -> Coding | None:
    """Return the coding of numbers that lack signs; None if signs are not missing.

    Parameters
    ----------
    x : array (n,)
        Values as recorded, NaN for missing ones.
    jumps : bool
        True if values with signs may jump, as torques do; positions do not.
    """
    x = x[np.isfinite(x)]
    most = float(np.max(x, initial=0.0))
    if most < LEAST or not could_lack_signs(x):
        return None
    half = float(2.0 ** np.floor(np.log2(most)))
    if np.count_nonzero(np.abs(np.diff(x)) > half / 2) < JUMPS:
        return None
    codings = [Coding(MAGNITUDE, half), Coding(COMPLEMENT, half)]
    steps = {None: _roughness(x)} | {each: _roughness(each.decode(x)) for each in codings}
    best, second = sorted(steps, key=lambda each: steps[each])[:2]
    if best is None or steps[best] > LEAVES * steps[second]:
        return None
    remain = np.abs(np.diff(best.decode(x))).max() > half / 2
    return None if remain and not jumps else best


def _roughness(x: Array) -> float:
    """Return the sum of squared steps."""
    return float(np.sum(np.diff(x) ** 2))


def turn_of(x: Array, turns: Sequence[float]) -> float | None:
    """Return the turn after which a column starts anew; None for a column without such jumps.

    Parameters
    ----------
    x : array (n,)
        Positions as recorded, NaN for missing ones.
    turns : sequence of float
        Possible turns, in the unit of the positions.
    """
    x = x[np.isfinite(x)]
    extent, steps = float(np.ptp(x)) if len(x) else 0.0, np.diff(x)
    jumps = np.flatnonzero(np.abs(steps) > extent / 2)
    # a joint at rest at the end of the turn flickers, an outlier is over at once
    apart = np.diff(np.concatenate([[-1], jumps, [len(steps)]])) > AROUND
    inner = jumps[apart[:-1] & apart[1:]]
    ordinary = np.abs(np.delete(steps, jumps))
    slow = AT_REST * AROUND * float(ordinary.mean()) if len(ordinary) else 0.0
    down = -np.sign(steps[inner])
    before, after = x[inner] - x[inner - AROUND], x[inner + 1 + AROUND] - x[inner + 1]
    goes_on = np.count_nonzero((down * before > slow) & (down * after > slow))
    if goes_on < max(JUMPS, len(inner) / 2):
        return None
    # a turn is passed within a step of both ends
    most = extent + 2 * float(ordinary.max(initial=0.0))
    fitting = [turn for turn in turns if (1 - 1e-9) * extent <= turn <= most]
    return min(fitting, default=None)


def jumps(x: Array) -> bool:
    """Return True if most of the squared steps are jumps over half of the range, unlike noise."""
    x = x[np.isfinite(x)]
    steps = np.abs(np.diff(x))
    far = steps[steps > np.ptp(x) / 2] if len(steps) else steps
    return bool(far @ far > LEAVES * (steps @ steps))


def register_turn(x: Array) -> float | None:
    """Return the count of a register of whole bits that holds all counts; None for other numbers.

    Parameters
    ----------
    x : array (n,)
        Positions as recorded, NaN for missing ones.
    """
    x = x[np.isfinite(x)]
    if not len(x) or np.any(x != np.floor(x)):
        return None
    least, most = float(x.min()), float(x.max()) + 1.0
    count = most if least >= 0 else 2 * max(-least, most)
    return float(2.0 ** np.ceil(np.log2(count))) if count >= 2 * LEAST else None


def overflow_of(x: Array) -> float | None:
    """Return the range of a register that overflows, in the unit of a column; else None.

    Values reach both ends of whole bits of their increment within an ordinary step, and go on from
    the other end; at a limit they would stay.
    """
    extent, steps = float(np.ptp(x)), np.abs(np.diff(x))
    jumps = steps > extent / 2
    stays = int(np.sum((x == x.min()) | (x == x.max())))
    if np.count_nonzero(jumps) < max(JUMPS, stays) or not (width := range_of(x)):
        return None
    reached = width <= extent + 2 * float(np.median(steps))
    smooth = _roughness(unwrap(x, width)) <= LEAVES * _roughness(x)
    return width if reached and smooth else None


def range_of(x: Array) -> float | None:
    """Return the range of the least register of whole bits whose increments a column has."""
    x = x[np.isfinite(x)]
    extent, least = float(np.ptp(x)) if len(x) else 0.0, increment(x) if len(x) else 0.0
    if not least:
        return None
    counts = (x - x.min()) / extent * np.rint(extent / least)
    count = 2.0 ** np.ceil(np.log2(counts.max() + 1))
    whole = np.abs(counts - np.rint(counts)).max() < 0.1
    return float(count * extent / counts.max()) if whole and count >= 2 * LEAST else None


def unwrap(x: Array, turn: float) -> Array:
    """Return positions without jumps of whole turns, from the first position on."""
    steps = np.diff(x[np.isfinite(x)])
    found = x.copy()
    found[np.isfinite(x)] -= turn * np.concatenate([[0.0], np.cumsum(np.round(steps / turn))])
    return found
