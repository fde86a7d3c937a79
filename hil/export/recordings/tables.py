"""A measurement as columns whose names state their units, and a run as a list of measurements.

Times, positions, torques, flags and numbers of strokes are as recorded, to the last bit; velocities
are there only where they were recorded. Set-points follow from the plan and are marked as derived.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from drivers.drive_bus import SampleFlag
from hil.planning.free_motion import FreeMotion
from hil.runs.set_points import set_points

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording_file import Measured

    Array = NDArray[np.float64]
    Values = Array | NDArray[np.uint8] | NDArray[np.int16]

UNKNOWN = "unknown unit"
"""Of torques whose gain is unknown."""
_IN_NAMES = {
    "rad": "rad",
    "m": "m",
    "rad/s": "rad_per_s",
    "m/s": "m_per_s",
    "N m": "Nm",
    "N": "N",
    UNKNOWN: "unknown_unit",
}
_FLAGS = ", ".join(f"{flag.value} {str(flag.name).lower()}" for flag in SampleFlag)
INDEX = ("id", "kind", "axes", "read", "session", "samples", "begins_s", "ends_s", "attempts",
         "findings")  # fmt: skip
"""Columns of the list of measurements."""


class Column(NamedTuple):
    """A column of a measurement's table.

    Attributes
    ----------
    name : str
        With the unit, such as ``q1_rad``: letters, digits and underscores.
    unit : str
        Empty for flags and numbers.
    what : str
        What it holds, in words.
    values : array (n,)
        NaN where a sample is missing.
    derived : bool
        Whether it was computed afterwards; what was not is as recorded.
    """

    name: str
    unit: str
    what: str
    values: Values
    derived: bool = False


def columns(robot: Robot, measured: Measured) -> tuple[Column, ...]:
    """Return the table of a measurement, time first."""
    return tuple(_columns(robot, measured))


def unknown_gains(motion: RecordedMotion) -> tuple[int, ...]:
    """Axes, from 1, whose torques are in units of unknown worth."""
    return (motion.unknown_gains or ()) if isinstance(motion, FreeMotion) else ()


def row(measured: Measured) -> tuple[str | int | float, ...]:
    """Return what the list of measurements states of one, in the order of `INDEX`.

    Axes are numbered from 1; ``axes`` are those that move, ``read`` those whose torque is read.
    """
    motion, recording = measured.measurement, measured.recording
    return (
        motion.id,
        motion.kind,
        " ".join(str(axis + 1) for axis in motion.moved),
        " ".join(str(axis + 1) for axis in motion.read),
        measured.session,
        recording.n_samples,
        float(recording.time[0]),
        float(recording.time[-1]),
        measured.attempts,
        "; ".join(finding.message for finding in measured.findings),
    )


def _columns(robot: Robot, measured: Measured) -> Iterator[Column]:
    motion, recording = measured.measurement, measured.recording

    def velocity_unit(axis: int) -> str:
        return f"{robot.position_unit(axis)}/s"

    def torque_unit(axis: int) -> str:
        return UNKNOWN if axis + 1 in unknown_gains(motion) else robot.torque_unit(axis)

    yield Column("time_s", "s", "time since the bus was entered in its session", recording.time)
    yield from _joints("q", "position", robot.position_unit, recording.q)
    if recording.qd is not None:
        yield from _joints("qd", "velocity", velocity_unit, recording.qd)
    yield from _joints("tau", "torque or force", torque_unit, recording.tau)
    planned = set_points(motion, recording)
    if planned is not None:
        for column in _joints("set", "set-point", robot.position_unit, planned):
            yield column._replace(derived=True)
    for axis, flags in enumerate(recording.flags.T, start=1):
        yield Column(f"flags{axis}", "", f"flags of joint {axis}, a sum of {_FLAGS}", flags)
    yield Column("stroke", "", "number of the stroke, -1 for none", recording.stroke)
    if recording.group is not None:
        what = "number of the period, block or pair of strokes, -1 for none"
        yield Column("group", "", what, recording.group)
    partner = "number of the partner's stroke, -1 for none"
    yield Column("partner_stroke", "", partner, recording.partner_stroke)


def _joints(
    letter: str, what: str, unit_of: Callable[[int], str], values: Array
) -> Iterator[Column]:
    for axis, each in enumerate(values.T):
        unit = unit_of(axis)
        name = f"{letter}{axis + 1}_{_IN_NAMES[unit]}"
        yield Column(name, unit, f"{what} of joint {axis + 1}", each)
