"""The limits that a drive keeps of its own against those of the drives file.

The driver writes the file's limits to the drives when it powers them on, but never wider ones than
a drive has of its own (`drivers.commissioning.effective_limits`): whoever set it up had a reason. A
verdict states which of the two holds; limits that are off in the drive become those of the file.
All is compared joint side, and only read.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.verdict import Grade, Verdict, graded
from drivers.drives_file import Basis

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

SLACK = 1e-3
"""A drive's limit may be narrower by this share: counts are rounded."""
_ACCELERATIONS = (
    objects.MAX_ACCELERATION,
    objects.MAX_DECELERATION,
    objects.QUICK_STOP_DECELERATION,
)


class _Limit(NamedTuple):
    entry: Entry
    key: str
    stated: float
    per_count: float
    unit: str
    own_holds: bool


def check_limits(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare position, velocity, torque and following error limits with the file.

    Parameters
    ----------
    server : RemoteDictionary
        The drive's object dictionary; only read.
    axis : AxisDrive
        What the drives file states.

    Raises
    ------
    DriveRefused, NodeSilent
        An object that cannot be read.
    """
    yield _range(server, axis)
    for limit in _limits(axis):
        found = server.find(limit.entry)
        if found is not None:
            yield _judge(server.label, limit, found)


def _range(server: RemoteDictionary, axis: AxisDrive) -> Verdict:
    check, limits = "software limits (607D)", axis.limits
    ends = [server.find(e) for e in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)]
    stated = f"file: [{limits.q_min:.4g}, {limits.q_max:.4g}]"
    low, high = ends
    if low is None or high is None:
        return Verdict(
            Grade.REFUSED, server.label, check, "missing", stated, "use a drive that has them"
        )
    if low >= high:
        return Verdict(Grade.OK, server.label, check, "off in the drive", f"{stated} is written")
    scale = AxisScale.of(axis)
    q_low, q_high = sorted(scale.position_from_counts(float(end)) for end in (low, high))
    slack = SLACK * (limits.q_max - limits.q_min)
    q_low_held, q_high_held = max(q_low, limits.q_min), min(q_high, limits.q_max)
    overlap = q_low_held < q_high_held
    return graded(
        q_low <= limits.q_min + slack and q_high >= limits.q_max - slack,
        Grade.WARNING if overlap else Grade.REFUSED,
        server.label,
        check,
        f"[{q_low:.4g}, {q_high:.4g}] {axis.unit}",
        stated,
        f"the tighter of both holds, [{q_low_held:.4g}, {q_high_held:.4g}] {axis.unit}: plan"
        " within it, or widen the drive's limits with the maker's tool"
        if overlap
        else "the two have nothing in common: correct sign, zero and gear in the drives file",
    )


def _limits(axis: AxisDrive) -> Iterator[_Limit]:
    scale, limits, unit = AxisScale.of(axis), axis.limits, axis.unit
    rpm, force = 2 * math.pi / 60 / axis.gear_ratio, "N m" if unit == "rad" else "N"
    for entry, key, stated, per_count, of in (
        (objects.MAX_PROFILE_VELOCITY, "velocity", limits.velocity, scale.velocity, f"{unit}/s"),
        (objects.MAX_MOTOR_SPEED, "velocity", limits.velocity, rpm, f"{unit}/s"),
        *(
            (entry, "acceleration", limits.acceleration, scale.acceleration, f"{unit}/s^2")
            for entry in _ACCELERATIONS
        ),
        (objects.MAX_TORQUE, "torque", limits.torque, scale.torque_limit, force),
    ):
        yield _Limit(entry, f"limits.{key}", stated, per_count, of, own_holds=True)
    if axis.current.basis is Basis.RATED_CURRENT:
        per_mille = abs(scale.torque)
        yield _Limit(
            objects.MAX_CURRENT, "limits.torque", limits.torque, per_mille, force, own_holds=True
        )
    yield _Limit(
        objects.FOLLOWING_ERROR_WINDOW, "following_error_window", axis.following_error_window,
        abs(scale.position), unit, own_holds=False,
    )  # fmt: skip


def _judge(place: str, limit: _Limit, found: int) -> Verdict:
    check = f"{limit.entry.name} ({limit.entry.index:04X})"
    stated = f"file: {limit.stated:.4g} {limit.unit}"
    if found in {0, (1 << 8 * limit.entry.size) - 1}:
        return Verdict(Grade.OK, place, check, "not set in the drive", f"{stated} is written")
    value = found * limit.per_count
    return graded(
        value + limit.per_count >= limit.stated * (1 - SLACK),
        Grade.WARNING,
        place,
        check,
        f"{value:.4g} {limit.unit}",
        stated,
        f"the drive's own is tighter and holds: plan within it, lower {limit.key}, correct the unit"
        " in the drives file if that is wrong, or widen it with the maker's tool"
        if limit.own_holds
        else f"the drive allows less than the file: lower {limit.key}, or the file's is written",
    )
