"""Warmth of a gear: the state that scales friction between cold and warm.

Friction falls while an axis moves, as its power warms the gear and motion stirs the lubricant, and
rises again at rest. One state of each axis stands for that, from 0 of a cold, rested gear to 1 of
one as warm as motion can make it:

    w' = (1 - w) (x / x0) / tau_warming - w / tau_cooling,

driven by what is measured, the mean speed x as a share of the axis's limit (`speed` of its law), of
which the friction power is much the same multiple at every speed; x0 = `REFERENCE`. Within a
stretch of one mean speed it relaxes exponentially. It scales the level of friction, all that
changes its sign with the direction, by

    1 + s (w - w_r),

with w_r the mean warmth of what the law of friction was found from, so that the law by itself is
friction at that warmth. Beyond what was seen warmth counts as the nearest that was.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from checked_files.yaml_file import FileModel

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from hil.estimation.friction.history import History

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

REFERENCE = 0.5
"""Mean speed, as share of the limit, that `warming` is stated for."""


class Warmth(FileModel):
    """How friction of one axis depends on its warmth.

    Attributes
    ----------
    warming : float
        Time constant of warming up at half the speed limit [s].
    cooling : float
        Time constant of cooling at rest [s].
    slope, slope_error : float
        Relative change of the level from w = 0 to 1, of the level at `reference`; standard error.
    reference : float
        Warmth at which the law stands.
    seen : tuple of two floats
        Least and greatest warmth of the measurements that the law was found from.
    wander : float
        Greatest difference of the level in one measurement from the law at its warmth, as a share.
    over_law, over_last : float
        Root mean square error of blocks of measurements held out: of the law at any warmth, and of
        the law at the level that was known last, each over that of the law at their warmth.
    """

    warming: float = Field(gt=0)
    cooling: float = Field(gt=0)
    slope: float
    slope_error: float = Field(ge=0)
    reference: float
    seen: tuple[float, float]
    wander: float
    over_law: float
    over_last: float

    def away(self, warmth: ArrayLike) -> Array:
        """Warmth less the law's own, no further than was seen, shape of `warmth`."""
        return np.asarray(np.clip(warmth, *self.seen) - self.reference, dtype=np.float64)

    def factor(self, warmth: ArrayLike) -> Array:
        """What the level of the law is multiplied by, shape of `warmth`."""
        return 1.0 + self.slope * self.away(warmth)

    def deviation(self, warmth: ArrayLike) -> Array:
        """Standard deviation of the level at a warmth, over that of the law; shape of `warmth`."""
        uncertain = self.slope_error * self.away(warmth)
        return np.asarray(np.hypot(self.wander * self.factor(warmth), uncertain))

    @property
    def cold(self) -> float:
        """Level at the least warmth seen over that of the law."""
        return float(self.factor(self.seen[0]))

    @property
    def warm(self) -> float:
        """Level at the greatest warmth seen over that of the law."""
        return float(self.factor(self.seen[1]))


def warmth_at(
    past: History, axis: int, warming: float, cooling: float, time: Array, start: float = 0.0
) -> Array:
    """Warmth of an axis at instants of its history, shape of `time`.

    Parameters
    ----------
    past : History
    axis : int
        From 0.
    warming, cooling : float
        Time constants [s].
    time : ndarray, shape (n,)
        [s].
    start : float
        Warmth where the history begins, cold by default.
    """
    ends = np.append(past.begin, past.end)
    heating = past.speed[:, axis] / REFERENCE / warming
    rate = heating + 1.0 / cooling
    states = relaxed(start, heating / rate, np.exp(-np.diff(ends) * rate))
    return np.asarray(np.interp(time, ends, states), dtype=np.float64)


def relaxed(start: float, goals: Array | Mask, left: Array) -> list[float]:
    """A state that goes from `start` to one goal after the other, shape (1 + n_goals,).

    Of its distance from each goal the share `left` remains.
    """
    steps = zip(left.tolist(), ((1.0 - left) * goals).tolist(), strict=True)
    return list(accumulate(steps, lambda state, step: step[0] * state + step[1], initial=start))
