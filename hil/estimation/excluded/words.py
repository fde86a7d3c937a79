"""Causes in words: names, axes and sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.excluded.backlash import WITHIN
from hil.estimation.excluded.causes import CAUSES

if TYPE_CHECKING:
    from hil.estimation.excluded.alternatives import Alternative
    from hil.estimation.excluded.battery import Test
    from hil.estimation.excluded.causes import Key
    from hil.estimation.excluded.columns import Columns
    from hil.model.robot import Robot

SI = {"I": "kg m²", "s": "kg m", "m": "kg"}
"""Units of a link's parameters by first letter."""


def rank_of(cause: str, *axes: int) -> tuple[int, ...]:
    """Return the sort key of a cause: row of the table, then axes."""
    return list(CAUSES).index(name_of((cause, 0))), *axes


def name_of(key: Key) -> str:
    """Return the name of a cause in the table."""
    return key[0].rstrip(" 0123456789")


def describe_cause(key: Key, part: str = "") -> str:
    """Describe a cause with its axis, or a column of a cause, as in commands and tables."""
    of_axis = f" of axis {key[1] + 1}" if key[1] >= 0 else ""
    return f"{key[0]}{of_axis} {part}".strip()


def unit_of(robot: Robot, key: Key, part: str = "") -> str:
    """Return the unit of a cause, or of a parameter of a load."""
    return SI[part[0]] if key[0] == "load" and part else CAUSES[name_of(key)].unit_of(robot, key[1])


def axes_of(robot: Robot, key: Key) -> tuple[int, ...]:
    """Return the axes of a cause, from 1."""
    if key[0] == "load":
        return (robot.n_joints,)
    return (key[1] + 1,) if key[1] >= 0 else ()


def describe_size(robot: Robot, every: Columns, key: Key, test: Test) -> str:
    """Describe a cause with the size."""
    cause, unit = CAUSES[name_of(key)], CAUSES[name_of(key)].unit_of(robot, key[1])
    if key[0] == "load":
        return cause.words
    if name_of(key) in ("torque ripple", "gravity"):
        size, error = float(np.hypot.reduce(test.size)), float(test.error.max())
        times = key[0].rsplit(maxsplit=1)[-1]
        often = "" if key[0] == "gravity" else " once" if times == "1" else f" {times} times"
        turn = f",{often} a turn" if often else ""
        return cause.sized(size, error, unit) + turn
    at = int(np.argmax(np.abs(test.size / test.error)))
    if name_of(key) == "backlash":  # the column neglects rebound and twist of the gear
        least, most = float(test.size[at]) / WITHIN, float(test.size[at]) * WITHIN
        return f"{cause.words} {least:.2g} to {most:.2g} {unit}"
    after = ""
    if key[0] == "slip":
        instant = float(every.names[test.columns[at]].part)
        after = f" after some {instant / 60:.0f} min"
    return cause.sized(test.size[at], test.error[at], unit) + after


def describe_reading(robot: Robot, each: Alternative) -> str:
    """Describe an alternative reading with the size."""
    cause = CAUSES[each.cause]
    if np.isnan(each.size):
        return cause.words
    unit = cause.unit_of(robot, each.axes[0] if each.axes else -1)
    if each.cause == "gravity":
        gravity = ", ".join(f"{x:.3g}" for x in each.explained.reading.gravity.round(2) + 0.0)
        sized = cause.sized(abs(each.size), each.error, unit)
        return f"{sized}, pointing along [{gravity}] in frame 0 of the run's robot.yaml"
    after = f" after some {each.instant / 60:.0f} min" if each.cause == "slip" else ""
    if each.cause == "sampling rate" and robot.revolute.all():
        # with lengths x L, masses m / x^2 and moments s / x keep torques of inertia, gravity is / x
        share = (1.0 + each.size / 100.0) ** -2
        after = f", or lengths in the robot file {share:.2g} times the true ones"
    return cause.sized(each.size, each.error, unit) + after
