"""Checks of a whole stream of set-points against the axes' limits, before anything is commanded.

Velocities and accelerations are differences of set-points, and the axes count as resting before the
first and after the last: a path that begins or ends in motion shows as an acceleration beyond all
limits. They may exceed their limit by `ROUNDING`, since a difference of rounded numbers does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402.set_point_limits import joint_of, where_to_widen
from drivers.drive_bus import LimitExceeded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drivers.axis import Axis

    Array = NDArray[np.float64]

ROUNDING = 1e-3
"""Share by which differences may exceed a limit."""
_SMALLER = "plan a slower or smaller motion"
_REVIEW = "plan a slower motion, check the model that it comes from"


def check_path(
    path: Array,
    axes: Sequence[Axis],
    here: Sequence[float],
    period: float,
) -> None:
    """Refuse set-points that leave the limits, or that do not begin where the axes stand.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m].
    axes : sequence of Axis
        In joint order.
    here : sequence of float
        Where the axes stand [rad or m].
    period : float
        Time between two set-points [s].

    Raises
    ------
    LimitExceeded
        With axis, instant, value, bound and remedy.
    """
    if path.ndim != 2 or path.shape[1] != len(axes) or len(path) < 2:
        raise LimitExceeded(
            f"path of shape {path.shape} must have 2 rows or more of {len(axes)} axes each"
        )
    still = np.vstack([path[:1], path[:1], path, path[-1:], path[-1:]])
    speed = np.diff(still, axis=0) / period
    bend = np.diff(speed, axis=0) / period
    for axis in axes:
        number, limits, unit = axis.index, axis.drive.limits, axis.drive.unit
        window = axis.drive.position_window
        _check_start(joint_of(axis), float(path[0, number]), here[number], window, unit)
        for what, values, low, high, per in (
            ("set-point", path[:, number], limits.q_min, limits.q_max, ""),
            ("velocity", speed[:, number], -limits.velocity, limits.velocity, "/s"),
            ("acceleration", bend[:, number], -limits.acceleration, limits.acceleration, "/s^2"),
        ):
            _check_range(axis, what, values, (low, high), unit + per, period, _SMALLER)


def check_feed_forward(
    path: Array,
    fed: Sequence[Array],
    axes: Sequence[Axis],
    period: float,
) -> None:
    """Refuse what is fed forward beyond the limits, or without beginning and ending with zero.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m].
    fed : three ndarrays, shape (n, n_axes)
        Velocity, torque, and what of it holds the axes [rad/s or m/s, N m or N].
    axes, period
        See `check_path`.

    Raises
    ------
    LimitExceeded
        With axis, instant, value, bound and remedy.
    """
    names = ("velocity", "torque", "holding torque")
    for what, values in zip(names, fed, strict=True):
        if values.shape != path.shape:
            raise LimitExceeded(
                f"{what} fed forward, of shape {values.shape}, must have the shape {path.shape} of"
                " the path; give one for each set-point"
            )
    for axis in axes:
        drive = axis.drive
        effort = (drive.limits.torque, drive.effort_unit)
        bounds = ((drive.limits.velocity, f"{drive.unit}/s"), effort, effort)
        for what, values, (limit, unit) in zip(names, fed, bounds, strict=True):
            own = values[:, axis.index]
            _check_range(
                axis, what, own, (-limit, limit), unit, period, _REVIEW, fed=" fed forward"
            )
            _check_ends(joint_of(axis), what, own, limit, unit)


def _check_ends(place: str, what: str, values: Array, limit: float, unit: str) -> None:
    for end, value in (("begins", values[0]), ("ends", values[-1])):
        if abs(value) > limit * ROUNDING:
            raise LimitExceeded(
                f"{place}: {what} fed forward {end} with {value:.5g} {unit}, it must be zero where"
                " the axes rest and their loops hold them; feed forward what the motion adds"
            )


def _check_start(place: str, first: float, here: float, window: float, unit: str) -> None:
    if not abs(first - here) <= window:
        raise LimitExceeded(
            f"{place}: the path begins at {first:.5g} {unit}, the axis stands at {here:.5g} {unit};"
            f" they may differ by {window:g} {unit} (position_window): move there first"
        )


def _check_range(
    axis: Axis,
    what: str,
    values: Array,
    bounds: tuple[float, float],
    unit: str,
    period: float,
    remedy: str,
    *,
    fed: str = "",
) -> None:
    """Refuse set-points outside their bounds, and others that exceed them by more than rounding."""
    (low, high), is_position = bounds, what == "set-point"
    slack = 0.0 if is_position else ROUNDING * high
    outside = np.flatnonzero(~((values >= low - slack) & (values <= high + slack)))
    if outside.size:
        first = int(outside[0])
        key = ("q_min" if values[first] < low else "q_max") if is_position else what
        raise LimitExceeded(
            f"{joint_of(axis)}: {what} {values[first]:.5g} {unit}{fed} after {first * period:.3g} s"
            f" of the path must be in [{low:.5g}, {high:.5g}] {unit}; {remedy}, or"
            f" {where_to_widen(axis.own, key)}"
        )
