"""Residual of a model over one fixed band: the same for all methods, robots and recordings.

Every method filters recordings in its own way, and the narrower the band, the less of a residual
passes. What is stated and judged is therefore computed apart from all methods, as any user can:
positions and torques pass a low-pass at `BAND`, the Butterworth filter of order 4 forth and back,
positions are differentiated, and the residual is

    e = tau - model.predict(q, qd, qdd),

as root mean squares over those of the torque. The unfiltered residual is that of the torque as it
was recorded, with all its noise and vibration, from the same prediction.

Friction jumps at a reversal. The low-pass rounds that jump off in the torque and not in the
prediction, which leaves a residual however right the model is: up to 20 % of the torque of an axis
that carries little but friction and reverses every second. So a model is judged by the smoothed
residual, of which both sides have passed the low-pass,

    e = LP tau - LP model.predict(q, qd, qdd),

with positions up to twice the band, so that the second pass changes accelerations like the torque.
What holds an axis at rest is no function of the motion, so that samples about a rest are left out
there: an axis rests that is slower than the share `SLOW` of its speed limit for a period of the
band.

Of each axis count the recordings in which the axis moves; of strokes and trajectories that were
measured here, the samples under way. A gap ends a motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.results.judgement import NOTABLE, doubtful

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.arrays import Array, Mask
    from hil.results.judgement import Reservation

BAND = 8.0
"""Cut-off of the low-pass of positions and torques [Hz]: a convention. Industrial arms accelerate
within less, and bend above some 10 Hz."""


class BandResidual(FileModel):
    """Residual of a model on recordings, axis by axis, up to `band` and unfiltered.

    Attributes
    ----------
    band : float
        Cut-off of the low-pass [Hz].
    torque, left : tuple of float or None
        Root mean squares of torque and residual up to `band` [N m or N]; None for an axis that
        did not move or whose friction is unknown.
    moving, smoothed : tuple of float or None
        The same where the axis does not rest, and the prediction passes the low-pass, too.
    recorded, unfiltered : tuple of float or None
        The same of the torque as it was recorded.
    """

    band: float
    torque: tuple[float | None, ...]
    left: tuple[float | None, ...]
    moving: tuple[float | None, ...]
    smoothed: tuple[float | None, ...]
    recorded: tuple[float | None, ...]
    unfiltered: tuple[float | None, ...]

    @property
    def relative(self) -> Array:
        """Residual up to `band` over the torque, shape (n_joints,); NaN where unknown."""
        return _ratio(self.left, self.torque)

    @property
    def relative_smoothed(self) -> Array:
        """Smoothed residual over the torque, away from rest; shape as of `relative`."""
        return _ratio(self.smoothed, self.moving)

    @property
    def relative_unfiltered(self) -> Array:
        """Residual of the torque as it was recorded over that torque; shape as of `relative`."""
        return _ratio(self.unfiltered, self.recorded)

    @property
    def overall(self) -> float:
        """Residual of all axes together over their torque, up to `band`."""
        return _together(self.left, self.torque)

    @property
    def overall_unfiltered(self) -> float:
        """Residual of all axes together over their torque, unfiltered."""
        return _together(self.unfiltered, self.recorded)

    def loaded(self, limit: Array) -> Mask:
        """Axes that carry load, shape (n_joints,).

        Those whose torque is more than the share `NOTABLE` of its limit or, where that is unknown,
        of the greatest torque of all axes.

        Parameters
        ----------
        limit : ndarray, shape (n_joints,)
            Of torques [N m or N]; NaN where unknown.
        """
        torque = _array(self.torque)
        least = NOTABLE * np.where(np.isfinite(limit), limit, np.nanmax(torque))
        return np.asarray(np.nan_to_num(torque) > least)

    def __str__(self) -> str:
        shown = self.relative_smoothed
        worst = int(np.nanargmax(shown)) if np.isfinite(shown).any() else -1
        away = f", of axis {worst + 1} {_percent(shown[worst])} in motion" if worst >= 0 else ""
        return (
            f"residual up to {self.band:g} Hz {_percent(self.overall)} of the torque (unfiltered"
            f" {_percent(self.overall_unfiltered)}){away}"
        )


def unexplained(found: BandResidual | None, limit: Array, accuracy: float) -> Iterator[Reservation]:
    """Return a doubt for each axis that carries load and of which too much remains, worst first.

    Parameters
    ----------
    found : BandResidual or None
    limit : ndarray, shape (n_joints,)
        Of torques [N m or N]; NaN where unknown.
    accuracy : float
        Smoothed residual over the torque that may remain.
    """
    if found is None:
        return
    left = np.where(found.loaded(limit), np.nan_to_num(found.relative_smoothed), 0.0)
    for axis in np.argsort(-left, kind="stable").tolist():
        if left[axis] > accuracy:
            yield doubtful(
                f"the model explains {100 * max(0.0, 1.0 - left[axis]):.0f} % of axis {axis + 1}:"
                f" {_percent(left[axis])} of its torque remain up to {found.band:g} Hz, at most"
                f" {_percent(accuracy)} may (--accuracy)",
                "record motions like those that are to be predicted, or check what the model lacks:"
                " springs, ripple, friction that depends on more than speed",
            )


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:.0f} %"


def _array(values: Iterable[float | None]) -> Array:
    return np.array([np.nan if each is None else each for each in values])


def _ratio(left: Iterable[float | None], torque: Iterable[float | None]) -> Array:
    return np.asarray(_array(left) / np.maximum(_array(torque), np.finfo(float).tiny))


def _together(left: Iterable[float | None], torque: Iterable[float | None]) -> float:
    below = max(float(np.sqrt(np.nansum(_array(torque) ** 2))), float(np.finfo(float).tiny))
    return float(np.sqrt(np.nansum(_array(left) ** 2))) / below
