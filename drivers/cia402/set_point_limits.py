"""Checks of set-points, paths and present positions against the axes' limits.

For a path, velocities and accelerations are differences of set-points, with the axes at rest before
the first and after the last: a path that begins or ends in motion exceeds every acceleration limit.
Differences of rounded numbers may exceed their limit by `ROUNDING`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import LimitExceeded

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from drivers.axis import Axis
    from drivers.drive_bus import Move

    Array = NDArray[np.float64]

ROUNDING = 1e-3
"""Share by which differences may exceed a limit."""
_SMALLER = "plan a slower or smaller motion"
_REVIEW = "plan a slower motion, check the model"


def check_move(move: Move, axis: Axis) -> None:
    """Refuse a set-point outside the limits of an axis.

    Parameters
    ----------
    move : Move
        The set-point.
    axis : Axis
        Axis of the move; messages count joints from 1.

    Raises
    ------
    LimitExceeded
        A value outside its bounds; with the remedy.
    """
    unit, own, scale = axis.drive.unit, axis.own, axis.scale
    limits, place = axis.drive.limits, joint_of(axis)
    if not limits.q_min <= move.target <= limits.q_max:
        side = "q_min" if move.target < limits.q_min else "q_max"
        raise LimitExceeded(
            f"{place}: target {move.target:g} {unit} must be in [{limits.q_min:g}, "
            f"{limits.q_max:g}] {unit}; choose another target or {where_to_widen(own, side)}"
        )
    for key, value, bound, least, per in (
        ("velocity", move.velocity, limits.velocity, scale.velocity, "/s"),
        ("acceleration", move.acceleration, limits.acceleration, scale.acceleration, "/s^2"),
    ):
        if not 0 < value <= bound * (1 + 1e-12) or math.isnan(value):
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} must be above 0 and at most {bound:g} "
                f"{unit}{per}; slow the move down or {where_to_widen(own, key)}"
            )
        if value < least:
            raise LimitExceeded(
                f"{place}: {key} {value:g} {unit}{per} is below the drive's resolution of "
                f"{least:g} {unit}{per}; choose a faster move"
            )


def refuse_outside(axes: Sequence[Axis], positions: Sequence[int]) -> None:
    """Refuse axes outside their limits, before any is energised.

    Parameters
    ----------
    axes : sequence of Axis
        Axes in joint order.
    positions : sequence of int
        Present positions [increments].

    Raises
    ------
    LimitExceeded
        Axes outside their limits, a line for each.
    """
    outside = []
    for axis in axes:
        q, limits = axis.scale.position_from_counts(positions[axis.index]), axis.drive.limits
        slack, unit = axis.drive.position_window, axis.drive.unit
        if not limits.q_min - slack <= q <= limits.q_max + slack:
            outside.append(
                f"{axis.label}: is at {q:.4g} {unit}, must be in [{limits.q_min:g}, "
                f"{limits.q_max:g}] {unit}; bring it back without power or with the maker's "
                "tool, or correct zero, sign or limits in the drives file"
            )
    if outside:
        raise LimitExceeded("\n".join(outside))


def joint_of(axis: Axis) -> str:
    """Return the name of an axis's joint in messages."""
    return f"joint {axis.index + 1} ({axis.drive.name})"


def where_to_widen(own: Mapping[str, str], key: str) -> str:
    """Return how to widen a limit, set by the drives file or by an object of the drive."""
    if key in own:
        return f"widen the drive's own limit {own[key]} with the maker's commissioning tool"
    return "correct the limits of the drives file"


def check_path(path: Array, axes: Sequence[Axis], here: Sequence[float], period: float) -> None:
    """Refuse set-points outside the limits, or a path that begins away from the axes' positions.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m].
    axes : sequence of Axis
        Axes in joint order.
    here : sequence of float
        Present positions [rad or m].
    period : float
        Time between two set-points [s].

    Raises
    ------
    LimitExceeded
        A value outside its bounds; with axis, instant and remedy.
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
        first, window = float(path[0, number]), axis.drive.position_window
        if not abs(first - here[number]) <= window:
            raise LimitExceeded(
                f"{joint_of(axis)}: the path begins at {first:.5g} {unit}, the axis is at "
                f"{here[number]:.5g} {unit}; they may differ by {window:g} {unit} "
                "(position_window): move to the path's beginning first"
            )
        for what, values, low, high, per in (
            ("set-point", path[:, number], limits.q_min, limits.q_max, ""),
            ("velocity", speed[:, number], -limits.velocity, limits.velocity, "/s"),
            ("acceleration", bend[:, number], -limits.acceleration, limits.acceleration, "/s^2"),
        ):
            _check_range(axis, what, values, (low, high), unit + per, period, _SMALLER)


def check_feed_forward(
    path: Array, fed: Sequence[Array], axes: Sequence[Axis], period: float
) -> None:
    """Refuse feed-forward beyond the limits, or without zero at both ends.

    Parameters
    ----------
    path : ndarray, shape (n, n_axes)
        Set-points [rad or m].
    fed : three ndarrays, shape (n, n_axes)
        Velocity, torque, and the part of the torque that holds the axes [rad/s or m/s, N m or N].
    axes, period
        See `check_path`.

    Raises
    ------
    LimitExceeded
        A value outside its bounds; with axis, instant and remedy.
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
            for end, value in (("begins", own[0]), ("ends", own[-1])):
                if abs(value) > limit * ROUNDING:
                    raise LimitExceeded(
                        f"{joint_of(axis)}: {what} fed forward {end} with {value:.5g} {unit}, "
                        "must be zero at rest; feed forward only the torque added by the motion"
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
    """Refuse values outside their bounds; all but set-points may exceed them by rounding."""
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
