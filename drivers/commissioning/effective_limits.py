"""Limits in force on an axis: the tighter ones of drive and drives file.

A drive's narrower limits have a reason, so none is ever widened: software limits (607D), speeds
(607F, 6080), accelerations (60C5, 60C6, 6085) and torque (6072, 6073). The value for the drive is
computed in the drive's own unit, so that its own limit stays exactly; the resulting limit of the
axis is computed in SI on the joint side, and set-points are checked against it. A limit of 0 or of
all ones is not set; position limits are off unless the lower one is below the upper one.

Positions may wrap around at the ends of a range (607B), as in drives of rotary axes. If the range
is wider than the travel of the axis, a position belongs to one place, wherever the drive wraps
around, and no missed telegram can make it wrong. On both sides of the axis's limits there must be
room for an axis that leaves them, until that is detected.

A target of profile position is in the same turn, or in the shortest direction, by option and maker;
the checked path may be neither. Hence the driver leads the axis by cyclic position, with the
nearest place as target, if positions wrap around within the limits. The limits of such a range
cannot be expressed in 607D: the driver alone keeps the range.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from drivers.axis import AxisScale, Wrap
from drivers.cia402 import objects
from drivers.commissioning.measures import FIELDS, measures
from drivers.commissioning.requirements import OWN_LIMITS, is_set
from drivers.drive_bus import DriveRefused
from drivers.drives_file import AxisLimits
from drivers.safety.trips import fastest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from drivers.commissioning.measures import Measure
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

ENDS = (objects.POSITION_RANGE_MIN, objects.POSITION_RANGE_MAX)
UNSEEN = 0.1
"""Longest time of an axis beyond its limits until the driver stops it [s]: ten SYNCs without a
telegram at 100 Hz."""
_ALL_COUNTS = 1 << 32
"""Number of positions of a 32-bit counter, which wraps around naturally."""


def range_of(find: Callable[[Entry], int | None]) -> tuple[int, int] | None:
    """Return the range of wrap-around positions; None without wrap-around."""
    try:
        low, high = map(find, ENDS)
    except DriveRefused:  # of a non-standard type, and not compared
        return None
    if low is None or high is None or not 0 < high - low < _ALL_COUNTS - 1:
        return None
    return low, high


def wrap_of(ends: tuple[int, int] | None, axis: AxisDrive, label: str) -> Wrap | None:
    """Return the wrap-around within an axis's limits; None if absent.

    Parameters
    ----------
    ends : tuple of int or None
        Range of the drive (`range_of`).
    axis : AxisDrive
    label : str
        Name of the drive in messages.

    Raises
    ------
    DriveRefused
        The range is too narrow for the axis.
    """
    if ends is None:
        return None
    low, high = ends
    scale, limits, slack = AxisScale.derive(axis), axis.limits, axis.position_window
    sides = (limits.q_min - slack, limits.q_max + slack)
    first, last = sorted(scale.position_to_counts(side) for side in sides)
    if low <= first <= last <= high:
        return None
    room = axis.following_error_window + UNSEEN * fastest(axis)
    size, needed = high - low + 1, last - first + 2 * round(room / abs(scale.position))
    if size < needed:
        raise DriveRefused(
            f"{label}: positions wrap around in [{low}, {high}] (607B); limits [{first}, {last}] "
            f"of the drives file, with a margin of {room:.3g} {axis.unit} on both sides, take "
            f"{needed} of {size} positions, so the place of the axis is ambiguous; home "
            "the drive to another zero, narrow the limits, or widen 607B with the "
            "maker's commissioning tool"
        )
    return Wrap(low, size, (first + last) // 2 - size // 2)


SLOWEST_STOP = 0.25
"""Smallest quick stop deceleration (6085) for an awaited stop, as a share of the axis limit."""

SLACK = 1e-3
"""Relative difference of a tighter limit that is not noted: rounding."""


@dataclass(frozen=True, slots=True)
class EffectiveLimits:
    """Limits in force on an axis.

    Attributes
    ----------
    limits : AxisLimits
        Limits on the joint side, SI.
    stop_deceleration : float or None
        Quick stop deceleration of the configured drive [rad/s^2 or m/s^2]; None if the drive has no
        6085 and its ramp is unknown.
    values : mapping of Entry to int
        Values for the limiting objects of the drive [drive's unit].
    own : mapping of str to str
        Field of `limits` to the object of the drive, where the drive's limit is tighter.
    notes : tuple of str
        Tighter limits for the operator, with both numbers, without the drive's name.
    wrap : Wrap or None
        Wrap-around of the drive's positions within the limits.
    """

    limits: AxisLimits
    stop_deceleration: float | None
    values: Mapping[Entry, int]
    own: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    wrap: Wrap | None = None

    def apply_to(self, axis: AxisDrive) -> AxisDrive:
        """Return the axis with the limits in force."""
        return axis.model_copy(update={"limits": self.limits})


class Bound(NamedTuple):
    """Limit of the drives file, and the corresponding object of the drive.

    Attributes
    ----------
    entry : Entry
        The object.
    key : str
        Field of `AxisLimits`.
    stated : float
        Value in the drives file [SI, joint side].
    measure : Measure
        Unit of the object.
    """

    entry: Entry
    key: str
    stated: float
    measure: Measure


def bounds(axis: AxisDrive) -> Iterator[Bound]:
    """Yield the limits of an axis, without the range."""
    counted = measures(axis)
    for row in OWN_LIMITS:
        assert row.quantity is not None  # noqa: S101 - a row of a limit has one
        key = FIELDS[row.quantity]
        yield Bound(row.entry, key, getattr(axis.limits, key), counted[row.quantity])


def effective_limits(
    find: Callable[[Entry], int | None], axis: AxisDrive, label: str
) -> EffectiveLimits:
    """Compute the limits in force from those of the drive and of the drives file.

    Parameters
    ----------
    find : callable
        Returns the value of an object before our writes, None if missing.
    axis : AxisDrive
    label : str
        Name of the drive in messages.

    Raises
    ------
    DriveRefused
        The two ranges of positions are disjoint, or positions wrap around in a range that is too
        narrow; an object cannot be read.
    NodeSilent
        No answer.
    """
    stated = axis.limits
    notes: list[str] = []
    values: dict[Entry, int] = {}
    own: dict[str, str] = {}
    ends = range_of(find)
    wrap = wrap_of(ends, axis, label)
    if wrap is None:
        range_ = _range(find, axis, label, values, own, notes)
    else:
        range_ = {"q_min": stated.q_min, "q_max": stated.q_max}
        values |= _unlimited(find, wrap, label)
    if ends is not None:
        values |= dict(zip(ENDS, ends, strict=True))
        wraps = f"positions wrap around at {ends[0]} and {ends[1]} increments (607B)"
        notes.append(
            f"{wraps}, beyond all positions that the drives file allows: no action"
            if wrap is None
            else f"{wraps}, within the limits of the drives file, unambiguous; the driver plans "
            "all motion, and only the driver enforces the range"
        )
    holds = {"velocity": stated.velocity, "torque": stated.torque}
    holds |= {"acceleration": stated.acceleration, _STOP: stated.acceleration}
    for bound in bounds(axis):
        entry, unit = bound.entry, bound.measure.unit
        present, ours = find(entry), bound.measure.counts(bound.stated)
        if present is not None and not ours:
            raise DriveRefused(
                f"{label}: limits.{bound.key} {bound.stated:.4g} {unit} is less than one count of"
                f" {entry}, {bound.measure.per_count:.4g} {unit}, and 0 would mean no limit; raise"
                " it, or set a finer unit in the drive"
            )
        values[entry] = ours
        if present is None or not is_set(present, entry) or present >= ours:
            continue
        values[entry] = present
        value = bound.measure.value(present)
        for key in _KEYS.get(entry, (bound.key,)):
            if value < holds[key]:
                holds[key], own[key] = value, f"{entry.index:04X}"
        if value < bound.stated * (1 - SLACK):
            notes.append(
                f"the drive's own {entry.name} ({entry.index:04X}) is {value:.4g} {unit}, "
                f"tighter than the drives file's limits.{bound.key} {bound.stated:.4g} {unit}; "
                "the drive's limit applies"
            )
    stop = holds.pop(_STOP) if find(_QUICK_STOP) is not None else None
    if stop is not None and stop < SLOWEST_STOP * stated.acceleration:
        notes.append(
            f"quick stop ramp {stop:.4g} {axis.unit}/s^2 (6085, 60C6; "
            f"{stated.velocity / stop:.3g} s from full speed) is below {SLOWEST_STOP:.0%} of "
            f"limits.acceleration {stated.acceleration:.4g} {axis.unit}/s^2: the voltage is "
            "disabled before its end; raise 6085 with the maker's commissioning tool, or "
            "state this ramp as quick_stop_deceleration"
        )
    limits = AxisLimits.model_validate({**range_, **{key: holds[key] for key in _FIELDS}})
    own.pop(_STOP, None)
    return EffectiveLimits(limits, stop, values, own, tuple(notes), wrap)


_FIELDS = ("velocity", "acceleration", "torque")
_RANGE = (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
_STOP = "stop_deceleration"
_QUICK_STOP = objects.QUICK_STOP_DECELERATION
_KEYS = {objects.MAX_DECELERATION: ("acceleration", _STOP), _QUICK_STOP: (_STOP,)}
"""Fields limited by a deceleration."""


def _range(
    find: Callable[[Entry], int | None],
    axis: AxisDrive,
    label: str,
    values: dict[Entry, int],
    own: dict[str, str],
    notes: list[str],
) -> dict[str, float]:
    """Return the range in force, and add to `values`, `own` and `notes`."""
    scale, limits, unit = AxisScale.derive(axis), axis.limits, axis.unit
    ours = sorted(scale.position_to_counts(q) for q in (limits.q_min, limits.q_max))
    low, high = ours
    present = [find(entry) for entry in _RANGE]
    if present[0] is not None and present[1] is not None and present[0] < present[1]:
        low, high = max(low, present[0]), min(high, present[1])
    seen = sorted(scale.position_from_counts(float(end)) for end in present if end is not None)
    q_present = f"[{', '.join(f'{q:.5g}' for q in seen)}]"
    if low >= high:
        raise DriveRefused(
            f"{label}: the drive's own software limits (607D) {q_present} and the drives file's "
            f"[{limits.q_min:.5g}, {limits.q_max:.5g}] {unit} do not overlap; correct zero, sign "
            "and gear in the drives file, or the limits in the drive"
        )
    values |= dict(zip(_RANGE, (low, high), strict=True))
    keys = ("q_min", "q_max") if scale.position > 0 else ("q_max", "q_min")
    holds = {"q_min": limits.q_min, "q_max": limits.q_max}
    tighter = [key for key, end, we in zip(keys, (low, high), ours, strict=True) if end != we]
    for key, end in zip(keys, (low, high), strict=True):
        if key in tighter:
            holds[key] = scale.position_from_counts(float(end))
            own[key] = "607D"
    slack = SLACK * (limits.q_max - limits.q_min)
    if any(abs(holds[key] - getattr(limits, key)) > slack for key in tighter):
        notes.append(
            f"the drive's own software limits (607D) {q_present} are narrower than the drives "
            f"file's [{limits.q_min:.5g}, {limits.q_max:.5g}] {unit}; used: "
            f"[{holds['q_min']:.5g}, {holds['q_max']:.5g}] {unit}"
        )
    return holds


def _unlimited(find: Callable[[Entry], int | None], wrap: Wrap, label: str) -> dict[Entry, int]:
    """Return software limits that permit every position, if possible those of the drive."""
    first, last = wrap.low, wrap.low + wrap.size - 1
    low, high = (find(entry) for entry in _RANGE)
    if low is None or high is None:
        low, high = first, last
    elif low < high and not low <= first < last <= high:
        raise DriveRefused(
            f"{label}: software limits (607D) [{low}, {high}] cut positions that wrap around in"
            f" [{first}, {last}] (607B) within the limits of the drives file; switch them off"
            " with the maker's commissioning tool, or home the drive to another zero"
        )
    return dict(zip(_RANGE, (low, high), strict=True))
