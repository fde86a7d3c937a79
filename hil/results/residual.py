"""Residual of a model over a fixed band, common to all methods, robots and recordings.

Every method filters recordings differently, and a narrower band passes less of a residual. The
stated residual is therefore computed independently of the methods, in a way that any user can
repeat. Positions and torques pass a low-pass at `BAND`, a Butterworth filter of order 4 applied
forth and back. Positions are differentiated, and the residual is

e = tau - model.predict(q, qd, qdd),

as root mean square relative to that of the torque. The unfiltered residual uses the same prediction
with the torque as recorded, with all its noise and vibration.

Friction jumps at a reversal. The low-pass smooths that jump in the torque and not in the
prediction, which leaves a residual even for a correct model: up to 20 % of the torque of an axis
with little but friction and a reversal every second. Therefore a model is judged by the smoothed
residual, with both sides filtered,

e = LP tau - LP model.predict(q, qd, qdd),

with positions up to twice the band, so that the second pass changes accelerations like the torque.
The torque of an axis at rest is no function of the motion, so the smoothed residual omits samples
near a rest. An axis is at rest if it is slower than the share `SLOW` of its speed limit for a
period of the band.

The residual of an axis includes the recordings in which the axis moves; from strokes and
trajectories measured here, only the samples in motion. Samples left out by the estimation are
excluded, and samples near a long interpolation (`hil.results.band_residual`). A gap ends a motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.results.judgement import NOTABLE, doubtful, failed
from hil.show.rounding import above

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.arrays import Array, Mask
    from hil.results.judgement import Reservation

BAND = 8.0
"""Cut-off of the low-pass of positions and torques [Hz], a convention. Industrial arms accelerate
within a narrower band, and bend above some 10 Hz."""


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
        Root mean squares as above while the axis moves, with a filtered prediction.
    recorded, unfiltered : tuple of float or None
        Root mean squares as above with the torque as recorded.
    noise : tuple of float or None
        Part of `smoothed` due to the noise of positions, from motions whose `smoothed` exceeds the
        tolerated share of the torque; empty in files of earlier versions.
    certain : tuple of float or None
        Part of `noise` that is not by chance; empty in files of earlier versions.
    """

    band: float
    torque: tuple[float | None, ...]
    left: tuple[float | None, ...]
    moving: tuple[float | None, ...]
    smoothed: tuple[float | None, ...]
    recorded: tuple[float | None, ...]
    unfiltered: tuple[float | None, ...]
    noise: tuple[float | None, ...] = ()
    certain: tuple[float | None, ...] = ()

    @property
    def worse_than_none(self) -> Mask:
        """Axes whose residual exceeds the torque itself, even without the noise of positions.

        Noise adds to the mean square, so the model without noise leaves the difference.
        """
        if not self.noise:
            return np.zeros(len(self.torque), dtype=bool)
        squares = (np.nan_to_num(_array(x)) ** 2 for x in (self.smoothed, self.noise, self.moving))
        left, noise, torque = squares
        return np.asarray(left - noise > torque)

    @property
    def relative_noise(self) -> Array:
        """Certain noise in `relative_smoothed`; shape as there, 0 where it was not needed."""
        return np.nan_to_num(_ratio(self.certain or (None,) * len(self.torque), self.moving))

    @property
    def relative_without_noise(self) -> Array:
        """Smoothed residual over the torque without certain noise; shape as in `relative`."""
        squares = self.relative_smoothed**2 - self.relative_noise**2
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    @property
    def relative(self) -> Array:
        """Residual up to `band` over the torque, shape (n_joints,); NaN where unknown."""
        return _ratio(self.left, self.torque)

    @property
    def relative_smoothed(self) -> Array:
        """Smoothed residual over the torque, away from rest; shape as in `relative`."""
        return _ratio(self.smoothed, self.moving)

    @property
    def relative_unfiltered(self) -> Array:
        """Unfiltered residual over the recorded torque; shape as in `relative`."""
        return _ratio(self.unfiltered, self.recorded)

    @property
    def overall(self) -> float:
        """Residual up to `band` over the torque, for all axes together."""
        return _together(self.left, self.torque)

    @property
    def overall_unfiltered(self) -> float:
        """Unfiltered residual over the torque, for all axes together."""
        return _together(self.unfiltered, self.recorded)

    def loaded(self, limit: Array) -> Mask:
        """Return a mask of axes with significant load, shape (n_joints,).

        The torque of such an axis exceeds the share `NOTABLE` of its limit, or of the greatest
        torque of all axes if the limit is unknown.

        Parameters
        ----------
        limit : ndarray, shape (n_joints,)
            Torque limits [N m or N]; NaN if unknown.
        """
        torque = _array(self.torque)
        least = NOTABLE * np.where(np.isfinite(limit), limit, np.nanmax(torque))
        return np.asarray(np.nan_to_num(torque) > least)

    def worst_first(self, limit: Array) -> Iterator[tuple[int, float]]:
        """Yield the loaded axes, from 0, with their residuals without noise, the greatest first.

        `limit` as in `loaded`.
        """
        left = np.where(self.loaded(limit), np.nan_to_num(self.relative_without_noise), 0.0)
        for axis in np.argsort(-left, kind="stable").tolist():
            if left[axis] > 0:
                yield axis, float(left[axis])

    def describe(self, limit: Array) -> str:
        """Describe the residual, with the worst loaded axis; `limit` as in `loaded`."""
        axis, left = next(self.worst_first(limit), (-1, 0.0))
        worst = f", worst loaded axis {axis + 1} with {_percent(left)} in motion" if left else ""
        if left and self.relative_noise[axis] > left:
            noise = _percent(float(self.relative_noise[axis]))
            worst += f" beside {noise} due to the noise of its position"
        return (
            f"residual up to {self.band:g} Hz {_percent(self.overall)} of the torque (unfiltered"
            f" {_percent(self.overall_unfiltered)}){worst}"
        )


def unexplained(
    found: BandResidual | None, limit: Array, accuracy: float, *, own_friction: bool = False
) -> Iterator[Reservation]:
    """Return an objection to every loaded axis with a large residual, the worst first.

    A model fails that predicts the torque of an axis worse than the torque 0 does, if friction was
    fitted in these recordings: elsewhere friction may be another.

    Parameters
    ----------
    limit : ndarray, shape (n_joints,)
        Torque limits [N m or N]; NaN if unknown.
    accuracy : float
        Tolerated smoothed residual over the torque.
    own_friction : bool
        True if the law of friction comes from these recordings alone.
    """
    if found is None:
        return
    worse = found.worse_than_none
    for axis, left in found.worst_first(limit):
        noise = float(found.relative_noise[axis])
        if left <= accuracy:
            return
        if worse[axis] and own_friction:
            yield failed(
                f"axis {axis + 1}: residual {_percent(float(found.relative_smoothed[axis]))} of "
                f"the torque up to {found.band:g} Hz, and noise of positions explains only "
                f"{_percent(noise)}: the model is worse than none",
                "check column, sign and unit of its torque, its gear ratio and rotor inertia",
            )
        elif noise > left:
            yield doubtful(
                f"axis {axis + 1}: noise of its position is {_percent(noise)} of the torque up to "
                f"{found.band:g} Hz, which hides whether the model leaves at most "
                f"{_percent(accuracy)} (--accuracy)",
                "record the encoder's full resolution, or faster motion",
            )
        else:
            yield doubtful(
                f"axis {axis + 1}: residual {above(left, accuracy)} % of the torque up to "
                f"{found.band:g} Hz, at most {_percent(accuracy)} allowed (--accuracy)",
                "record motions like those to be predicted, or check for effects missing in the "
                "model: springs, ripple, a moving base, friction that depends on more than speed",
            )


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:.0f} %"


def _array(values: Iterable[float | None]) -> Array:
    return np.array([np.nan if each is None else each for each in values])


def _ratio(left: Iterable[float | None], torque: Iterable[float | None]) -> Array:
    below = _array(torque)  # 0 for a joint without motor
    return np.asarray(_array(left) / np.where(below > 0, below, np.nan))


def _together(left: Iterable[float | None], torque: Iterable[float | None]) -> float:
    below = max(float(np.sqrt(np.nansum(_array(torque) ** 2))), float(np.finfo(float).tiny))
    return float(np.sqrt(np.nansum(_array(left) ** 2))) / below
