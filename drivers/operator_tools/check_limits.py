"""Check of the drives' own limits against those of the drives file.

At power-on the driver writes the file's limits to the drives, but never wider ones than the drive's
own (`drivers.commissioning.effective_limits`), which have a reason. A verdict states which limit is
in force; limits that are off in the drive become those of the file. The comparison is on the joint
side, by reading only.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.effective_limits import SLACK, Bound, bounds
from drivers.commissioning.measures import Quantity, measures
from drivers.commissioning.position_range import range_of, wrap_of
from drivers.commissioning.requirements import is_set
from drivers.commissioning.verdict import Grade, Verdict, grade_check

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary


def check_limits(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare range, velocity, torque and following error with the file (see `verdict.Check`)."""
    yield _range(server, axis)
    for bound in bounds(axis):
        found = server.find(bound.entry)
        if found is not None:
            own_holds = (
                "the drive's own is tighter and holds: plan within it, lower"
                f" limits.{bound.key}, correct the unit in the drives file if that is wrong, or"
                " widen it with the maker's tool"
            )
            yield _judge(server.label, bound, found, own_holds)
    key, measure = "following_error_window", measures(axis)[Quantity.DISTANCE]
    window = Bound(objects.FOLLOWING_ERROR_WINDOW, key, axis.following_error_window, measure)
    found = server.find(window.entry)
    if found is not None:
        remedy = f"the drive allows less than the file: lower {key}, or the file's is written"
        yield _judge(server.label, window, found, remedy)


def _range(server: RemoteDictionary, axis: AxisDrive) -> Verdict:
    check, limits = "software limits (607D)", axis.limits
    ends = [server.find(e) for e in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)]
    stated = f"file: [{limits.q_min:.4g}, {limits.q_max:.4g}]"
    low, high = ends
    if wrap_of(range_of(server.find), axis, server.label) is not None:
        kept = "the driver alone keeps the axis's range, since the drive's positions wrap around"
        return Verdict(Grade.WARNING, server.label, check, "no use (607B)", stated, kept)
    if low is None or high is None:
        return Verdict(
            Grade.REFUSED, server.label, check, "missing", stated, "use a drive that has them"
        )
    if low >= high:
        return Verdict(Grade.OK, server.label, check, "off in the drive", f"{stated} is written")
    scale = AxisScale.derive(axis)
    q_low, q_high = sorted(scale.position_from_counts(float(end)) for end in (low, high))
    slack = SLACK * (limits.q_max - limits.q_min)
    q_low_held, q_high_held = max(q_low, limits.q_min), min(q_high, limits.q_max)
    overlap = q_low_held < q_high_held
    return grade_check(
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


def _judge(place: str, bound: Bound, found: int, remedy: str) -> Verdict:
    """Warn of a drive's limit that is tighter than the file's."""
    measure = bound.measure
    check = f"{bound.entry.name} ({bound.entry.index:04X})"
    stated = f"file: {bound.stated:.4g} {measure.unit}"
    if not is_set(found, bound.entry):
        return Verdict(Grade.OK, place, check, "not set in the drive", f"{stated} is written")
    value = measure.value(found)
    return grade_check(
        value + measure.per_count >= bound.stated * (1 - SLACK),
        Grade.WARNING,
        place,
        check,
        f"{value:.4g} {measure.unit}",
        stated,
        remedy,
    )
