"""Which limits hold on an axis: of the drive's own and the drives file's, the tighter ones.

Whoever set up a drive with narrower limits had a reason, so none is ever widened: software limits
(607D), speeds (607F, 6080), accelerations (60C5, 60C6, 6085) and torque (6072, 6073). Of each, what
must stand in the drive is computed in the drive's own unit, so that a limit of its own is left as
it is to the last count; what follows for the axis is computed in SI on the joint side, and that is
what set-points are checked against. A limit of 0 or of all ones is not set; position limits are off
unless the lower one is below the upper one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.measures import FIELDS, measures
from drivers.commissioning.position_range import ENDS, range_of, wrap_of
from drivers.commissioning.requirements import OWN_LIMITS, is_set
from drivers.drive_bus import DriveRefused
from drivers.drives_file import AxisLimits

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from drivers.axis import Wrap
    from drivers.commissioning.measures import Measure
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

SLOWEST_STOP = 0.25
"""Share of an axis's acceleration limit: a slower ramp of its own (6085) is not waited for."""

SLACK = 1e-3
"""Share by which a drive's limit may be tighter without a note: rounding."""


@dataclass(frozen=True, slots=True)
class EffectiveLimits:
    """What holds on one axis.

    Attributes
    ----------
    limits : AxisLimits
        Joint side, SI.
    stop_deceleration : float or None
        Deceleration of a quick stop, as it stands in the drive once it is configured
        [rad/s^2 or m/s^2]; None where the drive has no 6085 and its ramp is the maker's.
    values : mapping of Entry to int
        What must stand in the drive, of the objects that limit it [the drive's unit].
    own : mapping of str to str
        Field of `limits` to the object of the drive that holds there, where the drive's is tighter.
    notes : tuple of str
        The same for the operator, with both numbers, and without the drive's name.
    wrap : Wrap or None
        How the drive's positions wrap around within the limits.
    """

    limits: AxisLimits
    stop_deceleration: float | None
    values: Mapping[Entry, int]
    own: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    wrap: Wrap | None = None

    def of(self, axis: AxisDrive) -> AxisDrive:
        """Return the axis with the limits that hold in place of the drives file's."""
        return axis.model_copy(update={"limits": self.limits})


class Bound(NamedTuple):
    """A limit of the drives file and an object of the drive that limits the same.

    Attributes
    ----------
    entry : Entry
        The object.
    key : str
        Field of `AxisLimits`.
    stated : float
        Its value in the drives file [SI, joint side].
    measure : Measure
        How the object counts it.
    """

    entry: Entry
    key: str
    stated: float
    measure: Measure


def bounds(axis: AxisDrive) -> Iterator[Bound]:
    """Yield what limits an axis beside its range."""
    counted = measures(axis)
    for row in OWN_LIMITS:
        assert row.quantity is not None  # noqa: S101 - a row of a limit has one
        key = FIELDS[row.quantity]
        yield Bound(row.entry, key, getattr(axis.limits, key), counted[row.quantity])


def effective_limits(
    find: Callable[[Entry], int | None], axis: AxisDrive, label: str
) -> EffectiveLimits:
    """Compare a drive's own limits with those of the drives file.

    Parameters
    ----------
    find : callable
        What an object held before we wrote to it, None where it is missing.
    axis : AxisDrive
        What the drives file states.
    label : str
        How messages name the drive.

    Raises
    ------
    DriveRefused
        The two ranges of positions have nothing in common, or positions wrap around in a range
        that is too narrow; an object that cannot be read.
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
        notes.append(_turns(ends, wrap))
    holds = {"velocity": stated.velocity, "torque": stated.torque}
    holds |= {"acceleration": stated.acceleration, _STOP: stated.acceleration}
    for bound in bounds(axis):
        present, ours = find(bound.entry), bound.measure.counts(bound.stated)
        if present is not None and not ours:
            raise DriveRefused(_too_small(label, bound))
        values[bound.entry] = ours
        if present is None or not is_set(present, bound.entry) or present >= ours:
            continue
        values[bound.entry] = present
        value = bound.measure.value(present)
        for key in _KEYS.get(bound.entry, (bound.key,)):
            if value < holds[key]:
                holds[key] = value
                own[key] = _code(bound.entry)
        if value < bound.stated * (1 - SLACK):
            notes.append(_note(bound, value))
    stop = holds.pop(_STOP) if find(_QUICK_STOP) is not None else None
    if stop is not None and stop < SLOWEST_STOP * stated.acceleration:
        notes.append(_slow_stop(stop, axis))
    limits = AxisLimits.model_validate({**range_, **{key: holds[key] for key in _FIELDS}})
    own.pop(_STOP, None)
    return EffectiveLimits(limits, stop, values, own, tuple(notes), wrap)


_FIELDS = ("velocity", "acceleration", "torque")
_RANGE = (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)
_STOP = "stop_deceleration"
_QUICK_STOP = objects.QUICK_STOP_DECELERATION
_KEYS = {objects.MAX_DECELERATION: ("acceleration", _STOP), _QUICK_STOP: (_STOP,)}
"""What a deceleration limits, beside the field that it is compared with."""


def _range(
    find: Callable[[Entry], int | None],
    axis: AxisDrive,
    label: str,
    values: dict[Entry, int],
    own: dict[str, str],
    notes: list[str],
) -> dict[str, float]:
    scale, limits = AxisScale.derive(axis), axis.limits
    entries = _RANGE
    ours = sorted(scale.position_to_counts(q) for q in (limits.q_min, limits.q_max))
    low, high = ours
    present = [find(entry) for entry in entries]
    if present[0] is not None and present[1] is not None and present[0] < present[1]:
        low, high = max(low, present[0]), min(high, present[1])
    q_present, unit = _joint(scale, present), axis.unit
    if low >= high:
        raise DriveRefused(
            f"{label}: the drive's own software limits (607D) {q_present} and the drives file's"
            f" [{limits.q_min:.5g}, {limits.q_max:.5g}] {unit} have nothing in common; correct"
            " zero, sign and gear in the drives file, or the limits in the drive"
        )
    values |= dict(zip(entries, (low, high), strict=True))
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
            f"the drive's own software limits (607D) {q_present} are narrower than the"
            f" drives file's [{limits.q_min:.5g}, {limits.q_max:.5g}] {unit}; what holds is"
            f" [{holds['q_min']:.5g}, {holds['q_max']:.5g}] {unit}"
        )
    return holds


def _unlimited(find: Callable[[Entry], int | None], wrap: Wrap, label: str) -> dict[Entry, int]:
    """Return software limits that leave the drive all its positions, as it has them if it does."""
    ends = (wrap.low, wrap.low + wrap.size - 1)
    low, high = (find(entry) for entry in _RANGE)
    if low is None or high is None:
        low, high = ends
    elif low < high and not (low <= ends[0] and ends[1] <= high):
        raise DriveRefused(
            f"{label}: software limits (607D) [{low}, {high}] cut positions that wrap around in"
            f" [{ends[0]}, {ends[1]}] (607B) within the limits of the drives file; switch them off"
            " with the maker's commissioning tool, or have the drive count from another zero"
        )
    return dict(zip(_RANGE, (low, high), strict=True))


def _turns(ends: tuple[int, int], wrap: Wrap | None) -> str:
    wraps = f"positions wrap around in [{ends[0]}, {ends[1]}] (607B)"
    if wrap is None:
        return f"{wraps}, outside the limits of the drives file"
    return (
        f"{wraps}, within the limits of the drives file: each of them is one place of the axis; the"
        " driver plans its ways and alone keeps its range"
    )


def _joint(scale: AxisScale, counts: list[int | None]) -> str:
    ends = [scale.position_from_counts(float(end)) for end in counts if end is not None]
    return f"[{', '.join(f'{q:.5g}' for q in sorted(ends))}]"


def _code(entry: Entry) -> str:
    return f"{entry.index:04X}"


def _too_small(label: str, bound: Bound) -> str:
    unit = bound.measure.unit
    return (
        f"{label}: limits.{bound.key} {bound.stated:.4g} {unit} is less than one count of"
        f" {bound.entry}, {bound.measure.per_count:.4g} {unit}, and 0 would mean no limit; raise"
        " it, or set a finer unit in the drive"
    )


def _slow_stop(stop: float, axis: AxisDrive) -> str:
    unit, limits = axis.unit, axis.limits
    return (
        f"its quick stop slows down by {stop:.4g} {unit}/s^2 (6085, 60C6), which takes"
        f" {limits.velocity / stop:.3g} s from full speed; a ramp below {SLOWEST_STOP:.0%} of"
        f" limits.acceleration {limits.acceleration:.4g} {unit}/s^2 is not waited for, its voltage"
        " is disabled sooner: raise 6085 with the maker's commissioning tool, or state this ramp as"
        " quick_stop_deceleration"
    )


def _note(bound: Bound, value: float) -> str:
    unit = bound.measure.unit
    return (
        f"the drive's own {bound.entry.name} ({_code(bound.entry)}) is {value:.4g} {unit}, tighter"
        f" than the drives file's limits.{bound.key} {bound.stated:.4g} {unit}; the drive's holds"
    )
