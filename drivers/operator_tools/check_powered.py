"""Powered part of `hil drives check`: holding, rate of SYNC, a small move of each axis.

The axes are powered as for a run: first they hold their position for a second, then one after the
other moves in both directions. However the check ends, leaving the driver stops the axes and
switches them off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drivers.commissioning.verdict import Grade, Verdict, grade_check
from drivers.drive_bus import DriveError, SampleFlag
from drivers.operator_tools.check_current import CurrentReadings, judge_current_unit
from drivers.operator_tools.check_motion import Moved, judge_direction, judge_rest, judge_strokes
from drivers.operator_tools.operator import StoppedByOperator, answer, supervised_sample
from drivers.operator_tools.small_move import format_coordinate, small_move, travel
from drivers.operator_tools.sync_period import judge_period
from drivers.session.servo_axes import ServoAxes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.operator_tools.check_motion import Gravity
    from drivers.operator_tools.operator import Operator
    from drivers.session.connection import Fieldbus

REST_TIME = 1.0
"""Duration of observation at rest, powered and unpowered [s]."""
HELD_TIME = 0.1
"""Duration of observation of an axis before its move [s]."""
ANSWERED = 0.99
"""Smallest share of answered SYNCs."""
_GAPS = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE


@dataclass(frozen=True, slots=True)
class SmallMoves:
    """Distance and speed of the small moves in a check.

    Attributes
    ----------
    angle, angular_velocity : float
        Of revolute axes [rad], [rad/s].
    length, velocity : float
        Of prismatic axes [m], [m/s].
    """

    angle: float = math.radians(3)
    angular_velocity: float = math.radians(5)
    length: float = 0.005
    velocity: float = 0.01

    def find(self, axis: AxisDrive) -> tuple[float, float]:
        """Return distance and velocity of an axis."""
        if axis.joint == "prismatic":
            return self.length, self.velocity
        return self.angle, self.angular_velocity


def check_powered(
    bus: Fieldbus,
    drives: DrivesFile,
    moves: SmallMoves,
    operator: Operator,
    keeper: SettingsKeeper | None = None,
    gravity: Gravity | None = None,
    late: float = 0.0,
) -> Iterator[Verdict]:
    """Yield the powered checks; an error ends them with a verdict, after the axes are off."""
    step = "power-on"
    try:
        with bus.timed(drives) as timed, ServoAxes(timed, drives, keeper=keeper) as axes:
            step = "holding position"
            # remarks of power-on, except those visible without power
            configured = {str(note): note for server in axes.servers for note in server.notes}
            for text in axes.notes:
                note = configured.get(text)
                if note is None:
                    yield Verdict(Grade.WARNING, "all axes", "switching on", text)
                elif not note.lack:
                    yield Verdict(Grade.WARNING, note.place, "configuration", note.text)
            yield from _rest(axes, drives, operator)
            yield judge_period(timed, axes.period, late)
            for remark in axes.remarks:
                what, _, found = remark.partition(": ")
                yield Verdict(Grade.OK, "bus", what, found)
            for number, axis in enumerate(axes.held):
                step = f"small move of {axis.drive.name}"
                yield from _move(axes, number, axis.drive, moves, operator, gravity)
    except StoppedByOperator:
        raise
    except DriveError as error:
        # each line names its axis, if it concerns one; all are off
        labels = [f"{axis.name} (node {axis.node})" for axis in drives.axes]
        for line in str(error).splitlines():
            place = next((label for label in labels if line.startswith(f"{label}: ")), "all axes")
            yield Verdict(Grade.REFUSED, place, step, line.removeprefix(f"{place}: "))


def _rest(axes: ServoAxes, drives: DrivesFile, operator: Operator) -> Iterator[Verdict]:
    count = round(REST_TIME / axes.period)
    samples = [supervised_sample(axes, operator) for _ in range(count)]
    q = np.array([sample.q for sample in samples])
    tau = np.array([sample.tau for sample in samples])
    gaps = np.array([sample.flags for sample in samples]) & _GAPS
    for number, (server, axis) in enumerate(zip(axes.servers, drives.axes, strict=True)):
        yield _judge_gaps(server.label, gaps[:, number], axes.period)
        yield from judge_rest(server.label, axis, q[:, number], tau[:, number])


def _judge_gaps(place: str, gaps: NDArray[np.int64], period: float) -> Verdict:
    good = int(np.count_nonzero(gaps == 0))
    return grade_check(
        good >= ANSWERED * gaps.size,
        Grade.REFUSED,
        place,
        "TPDOs at each SYNC",
        f"{good} of {gaps.size} at {1 / period:.4g} Hz",
        f"at least {ANSWERED:.0%}",
        "lengthen sync_period, check wiring and termination",
    )


def _move(
    axes: ServoAxes,
    number: int,
    drive: AxisDrive,
    moves: SmallMoves,
    operator: Operator,
    gravity: Gravity | None,
) -> Iterator[Verdict]:
    label = axes.servers[number].label
    rests = range(math.ceil(HELD_TIME / axes.period))
    held = [supervised_sample(axes, operator) for _ in rests]
    pose = held[-1].q
    start = pose[number]
    limits = drive.limits
    way, velocity = moves.find(drive)
    way = way if start + way <= limits.q_max else -way
    if not limits.q_min <= start + way <= limits.q_max:
        yield Verdict(
            Grade.REFUSED, label, "small move", f"no room at q = {start:.4g}",
            f"[{limits.q_min:.4g}, {limits.q_max:.4g}]", "correct zero, or move the axis by hand",
        )  # fmt: skip
        return
    readings = CurrentReadings(axes.servers[number], drive)
    strokes = [
        travel(axes, number, drive, small_move(drive, target, velocity), operator, readings.poll)
        for target in (start + way, start)
    ]
    torque = np.array([sample.tau[number] for sample in held])
    seen = Moved(label, drive, number, np.array(pose), torque, readings.counts, strokes)
    yield from judge_strokes(seen)
    yield judge_current_unit(seen)
    yield judge_direction(seen, gravity)
    yield _ask_direction(axes, label, drive, way, operator)


def _ask_direction(
    axes: ServoAxes, label: str, drive: AxisDrive, way: float, operator: Operator
) -> Verdict:
    """Ask for direction and size of the motion, which only the operator can see."""
    moved, check = format_coordinate(drive, way, "+.3g"), "sign and size of the motion"
    if not operator.present:
        remedy = "nobody was asked: see that a jog turns the joint as the robot file has it"
        return Verdict(Grade.WARNING, label, check, moved, remedy=remedy)
    key = answer(
        axes,
        operator,
        f"{label}: moved {moved} and back. Was that so, by the robot file's sense of rotation? "
        "[y]es, [o]pposite direction, [w]rong amount",
        "yow",
    )
    remedies = {
        "o": f"set sign: {-drive.sign} in the drives file",
        "w": "correct gear_ratio or increments_per_revolution",
    }
    shown = {"y": "as seen", "o": "the other way", "w": "another amount"}[key]
    return grade_check(key == "y", Grade.REFUSED, label, check, shown, moved, remedies.get(key, ""))
