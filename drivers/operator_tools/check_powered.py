"""Powered part of `hil drives check`: holding, rate of SYNC, a small move of each axis.

The axes are powered as for a run: first they hold their position for a second, then one after the
other moves in both directions. However the check ends, leaving the driver stops the axes and
switches them off.

The unit of the current is checked by physical plausibility, with one of two methods. If the drive
shows torque (6077) besides the current, both are read by SDO in immediate succession, at rest and
during slow strokes. Their ratio is that of the units::

    counts per count of 6077 = T / (kt a)        current in mA: T in N m, kt in N m/A
                               T / (kt a I)      in per mille of the rated current I
                               1                 in per mille of the rated torque T

The nearest ratio gives the unit, if near enough. Otherwise the magnitude decides, roughly: no motor
holds more than its rated torque for long, and the friction of a geared axis at slow speed is a few
per cent of rated torque. Shares beyond `HELD_MAX` and outside `FRICTION` count as impossible, and a
unit is confirmed only if no other is possible.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from drivers.axis import motor_torque_per_count
from drivers.cia402 import objects
from drivers.commissioning.verdict import Grade, Verdict, grade_check, undecided
from drivers.drive_bus import DriveError, DriveRefused, SampleFlag
from drivers.drives_file import Basis
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
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Fieldbus

CHECK = "unit of the current"
LEAST_COUNTS = 10.0
"""Smallest root mean square of 6077; below, rounding and noise prevail."""
LINEAR = 0.9
"""Smallest squared correlation of the two objects; below, they show different quantities."""
NEAR = 1.3
"""Largest factor between measured and expected ratio: the tolerance of data sheets."""
ALIKE = 1.05
"""Largest factor between units that need not be distinguished."""
HELD_MAX = 1.2
"""Largest holding torque as a share of the rated torque."""
FRICTION = (0.003, 0.6)
"""Range of friction at slow speed as a share of the rated torque."""
POLLED = 0.05
"""Time between two readings [s]."""
_REMEDY = "raise --angle, or check a loaded axis; otherwise take the unit from the drive's manual"


class CurrentReadings:
    """Simultaneous readings of 6077 and the current object of an axis.

    Parameters
    ----------
    server : RemoteDictionary
        The drive.
    axis : AxisDrive
    """

    def __init__(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        self._server = server
        self._entries = (objects.TORQUE, axis.current.entry)
        alone = axis.current.index == objects.TORQUE.index
        self._next = math.inf if alone else -math.inf
        self._pairs: list[tuple[float, ...]] = []

    @property
    def counts(self) -> NDArray[np.float64]:
        """Counts of 6077 and of the current object, shape (n, 2)."""
        return np.array(self._pairs, dtype=float).reshape(-1, 2)

    def poll(self, time: float) -> None:
        """Read both objects when due; a drive without one of them is not asked again."""
        if time < self._next:
            return
        try:
            pair = tuple(self._server.measure(entry) for entry in self._entries)
        except DriveRefused:
            self._next = math.inf
            return
        self._next = time + POLLED
        self._pairs.append(pair)


def judge_current_unit(seen: Moved) -> Verdict:
    """Judge the current's unit in the drives file."""
    ratio = _ratio(seen.counts)
    if ratio is None:
        return _judge_by_magnitude(seen)
    return _judge_by_ratio(seen.place, seen.drive, ratio)


def _ratio(counts: NDArray[np.float64]) -> float | None:
    """Return the slope of the current object over 6077, without sign; None if meaningless."""
    reference, measured = counts.T
    if counts.shape[0] < 4 or math.sqrt(float(np.mean(reference**2))) < LEAST_COUNTS:
        return None
    squares = float(reference @ reference), float(measured @ measured)
    product = float(reference @ measured)
    if product**2 < LINEAR * squares[0] * squares[1]:
        return None
    return abs(product) / squares[0]


def _judge_by_ratio(place: str, drive: AxisDrive, ratio: float) -> Verdict:
    expected, stated = _expected(drive), drive.current.basis
    found = f"{ratio:.3g} counts of the current object per count of 6077"
    bound = f"{stated.value}: {expected[stated]:.3g}"
    apart = _apart(ratio, expected[stated])
    others = [b for b, value in expected.items() if _apart(value, expected[stated]) > ALIKE]
    nearer = [b.value for b in others if _apart(ratio, expected[b]) < min(apart, NEAR)]
    if apart < NEAR and not nearer:
        return Verdict(Grade.OK, place, CHECK, f"confirmed, {found}", bound)
    if apart >= NEAR and nearer:
        remedy = f"set basis: {' or '.join(nearer)}"
        return Verdict(Grade.REFUSED, place, CHECK, f"contradicts, {found}", bound, remedy)
    if apart >= NEAR:
        confused = _apart(apart, math.sqrt(2)) < ALIKE
        times = drive.current.per_count * expected[stated] / ratio
        remedy = f"the ratio suggests per_count: {times:.2g}; see the drive's manual"
        if confused:
            remedy = "a factor of 1.41: rms and peak are confused"
        return Verdict(Grade.WARNING, place, CHECK, f"contradicts, {found}", bound, remedy)
    return undecided(place, CHECK, f"{found}, and {' or '.join(nearer)} is nearer", _REMEDY)


def _expected(drive: AxisDrive) -> dict[Basis, float]:
    """Return the expected counts per count of 6077, by the basis of the current object."""
    torques = {basis: motor_torque_per_count(drive, basis) for basis in Basis}
    return {basis: drive.rated_torque / 1000 / value for basis, value in torques.items() if value}


def _judge_by_magnitude(seen: Moved) -> Verdict:
    place, drive, held = seen.place, seen.drive, seen.held
    rated = drive.gear_ratio * drive.rated_torque
    friction, error = seen.friction
    rest = abs(float(np.nanmean(held))) / rated if np.isfinite(held).any() else 0.0
    moved = abs(friction) / rated if abs(friction) > 4 * error else math.nan
    shown = "too little friction" if math.isnan(moved) else f"friction {moved:.1%}"
    found = f"{rest:.1%} of the rated torque at rest, {shown}"
    counts = _expected(drive)
    factors = {basis: counts[drive.current.basis] / value for basis, value in counts.items()}
    (low, high), possible = FRICTION, []
    for basis, factor in factors.items():
        plausible = math.isnan(moved) or low <= moved * factor <= high
        if rest * factor <= HELD_MAX and plausible:
            possible.append(basis)
    bound = f"at rest at most {HELD_MAX:.0%}, friction {FRICTION[0]:.1%} to {FRICTION[1]:.0%}"
    if drive.current.basis not in possible:
        names = " or ".join(basis.value for basis in possible)
        remedy = f"plausible as {names}" if names else "check rated_torque and current"
        return Verdict(Grade.WARNING, place, CHECK, f"contradicts, {found}", bound, remedy)
    if all(_apart(factors[basis], 1) < ALIKE for basis in possible) and not math.isnan(moved):
        return Verdict(Grade.OK, place, CHECK, f"confirmed, {found}", bound)
    return undecided(place, CHECK, found, _REMEDY)


def _apart(one: float, other: float) -> float:
    """Return the factor between two positive numbers, at least 1."""
    return math.inf if not one or not other else max(one / other, other / one)


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
        Distance and speed of revolute axes [rad], [rad/s].
    length, velocity : float
        Distance and speed of prismatic axes [m], [m/s].
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
        # each line names its axis, if only one is concerned; all axes are off
        labels = [f"{axis.name} (node {axis.node})" for axis in drives.axes]
        for line in error.lines.splitlines():
            place = next((label for label in labels if line.startswith(f"{label}: ")), "all axes")
            yield Verdict(Grade.REFUSED, place, step, line.removeprefix(f"{place}: "))


def _rest(axes: ServoAxes, drives: DrivesFile, operator: Operator) -> Iterator[Verdict]:
    count = round(REST_TIME / axes.period)
    samples = [supervised_sample(axes, operator) for _ in range(count)]
    q = np.array([sample.q for sample in samples])
    tau = np.array([sample.tau for sample in samples])
    gaps = np.array([sample.flags for sample in samples]) & _GAPS
    for number, (server, axis) in enumerate(zip(axes.servers, drives.axes, strict=True)):
        good = int(np.count_nonzero(gaps[:, number] == 0))
        yield grade_check(
            good >= ANSWERED * len(gaps),
            Grade.REFUSED,
            server.label,
            "TPDOs at each SYNC",
            f"{good} of {len(gaps)} at {1 / axes.period:.4g} Hz",
            f"at least {ANSWERED:.0%}",
            "lengthen sync_period, check wiring and termination",
        )
        yield from judge_rest(server.label, axis, q[:, number], tau[:, number])


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
        remedy = "not asked: check that a jog turns the joint as in the robot file"
        return Verdict(Grade.WARNING, label, check, moved, remedy=remedy)
    key = answer(
        axes,
        operator,
        f"{label}: moved {moved} and back. Was that correct, by the sense of rotation in the "
        "robot file? [y]es, [o]pposite direction, [w]rong amount",
        "yow",
    )
    remedies = {
        "o": f"set sign: {-drive.sign} in the drives file",
        "w": "correct gear_ratio or increments_per_revolution",
    }
    shown = {"y": "correct", "o": "opposite direction", "w": "wrong amount"}[key]
    return grade_check(key == "y", Grade.REFUSED, label, check, shown, moved, remedies.get(key, ""))
