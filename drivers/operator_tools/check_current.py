"""Check of the current's unit in a drive, by physical plausibility.

There are two methods. If the drive shows torque (6077) besides the current, both are read by SDO in
immediate succession, at rest and during slow strokes. Their ratio is that of the units::

    counts per count of 6077 = T / (kt a)        current in mA: T in N m, kt in N m/A
                               T / (kt a I)      in per mille of the rated current I
                               1                 in per mille of the rated torque T

The nearest is the unit, if near enough. Otherwise the magnitude decides, roughly: no motor holds
more than its rated torque for long, and the friction of a geared axis at slow speed is a few per
cent of it. Shares beyond `HELD_MAX` and outside `FRICTION` count as impossible, and a unit is
confirmed only if no other is possible.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drivers.axis import motor_torque_per_count
from drivers.cia402 import objects
from drivers.commissioning.verdict import Grade, Verdict, undecided
from drivers.drive_bus import DriveRefused
from drivers.drives_file import Basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive
    from drivers.operator_tools.check_motion import Moved
    from drivers.remote_dictionary import RemoteDictionary

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
_REMEDY = "move farther, or an axis that carries a load; else take it from the drive's manual"


class CurrentReadings:
    """Simultaneous readings of 6077 and the current object of an axis.

    Parameters
    ----------
    server : RemoteDictionary
        The drive.
    axis : AxisDrive
        Axis of the drives file.
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
    """Return the slope of the measured counts over those of 6077, None if meaningless."""
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
    found = f"{ratio:.3g} counts per count of 6077"
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
        remedy = f"see its manual: in its unit one count would be per_count: {times:.2g}"
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
    found = f"{rest:.1%} of the rated torque held, {shown}"
    counts = _expected(drive)
    factors = {basis: counts[drive.current.basis] / value for basis, value in counts.items()}
    (low, high), possible = FRICTION, []
    for basis, factor in factors.items():
        plausible = math.isnan(moved) or low <= moved * factor <= high
        if rest * factor <= HELD_MAX and plausible:
            possible.append(basis)
    bound = f"held at most {HELD_MAX:.0%}, friction {FRICTION[0]:.1%} to {FRICTION[1]:.0%}"
    if drive.current.basis not in possible:
        names = " or ".join(basis.value for basis in possible)
        remedy = f"it would be possible as {names}" if names else "check rated_torque and current"
        return Verdict(Grade.WARNING, place, CHECK, f"contradicts, {found}", bound, remedy)
    if all(_apart(factors[basis], 1) < ALIKE for basis in possible) and not math.isnan(moved):
        return Verdict(Grade.OK, place, CHECK, f"confirmed, {found}", bound)
    return undecided(place, CHECK, found, _REMEDY)


def _apart(one: float, other: float) -> float:
    """Return the factor between two positive numbers, at least 1."""
    return math.inf if not one or not other else max(one / other, other / one)
