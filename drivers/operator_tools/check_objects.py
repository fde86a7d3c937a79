"""Checks of the objects of a drive without power: scaling, reactions and limits.

Scaling: torques are proportional to the rated values, positions to encoder and gear: an error of
these is an error of every result of the axis and shows in no residual. So each is read by SDO,
nothing is written, and a contradiction is refused. Values not stated by a drive are taken on trust,
with a remark.

Reactions: three reactions are the drive's own, without influence of the driver: on a fault (605E),
when disabled (605C) and when shut down (605B). Option 0 removes the torque at once, so that the
axis coasts, and a hanging one falls until its brake has closed. Quick stop (605A) and the reaction
to a lost connection (6007) are written before a run; the values found apply to every other master.

Limits: at power-on the driver writes the file's limits to the drives, but never wider ones than the
drive's own (`drivers.commissioning.effective_limits`), which have a reason. A verdict states which
limit is in force; limits that are off in the drive become those of the file. The comparison is on
the joint side, by reading only.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.objects import MAKERS
from drivers.cia402.supervision import safe_torque_off
from drivers.commissioning.consistency import GEAR, SAME_GEAR, another_gear, comparisons
from drivers.commissioning.effective_limits import SLACK, Bound, bounds, range_of, wrap_of
from drivers.commissioning.measures import Quantity, measures
from drivers.commissioning.position_units import PositionFactors
from drivers.commissioning.ratings import CURRENT, TORQUE, expected_torque
from drivers.commissioning.requirements import is_set
from drivers.commissioning.verdict import Grade, Verdict, grade_check, unknown
from drivers.drives_file import Basis

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drives_file import AxisDrive
    from drivers.remote_dictionary import RemoteDictionary


CONSISTENT = 0.1
"""Largest relative difference of rated torque and torque constant times rated current."""


def check_scaling(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare ratings, encoder, gear and units of a drive with the file (see `verdict.Check`)."""
    compared = list(comparisons(server, axis))
    for comparison in compared:
        yield comparison.make_verdict(server.label)
    if axis.current.basis is not Basis.RATED_TORQUE:
        sure = {each.check for each in compared if each.grade is Grade.OK}
        yield _judge_constant(server.label, axis, rated={CURRENT, TORQUE} <= sure)
    yield from _judge_gear(server, axis)
    present = server.find(objects.POLARITY)
    yield grade_check(
        not present,
        Grade.WARNING,
        server.label,
        "polarity (607E)",
        "not reversed" if not present else f"{present:02X}h",
        "",
        "the drive reverses position or velocity: sign must include this; verify it by a jog",
    )
    entry = axis.current.entry
    value = server.measure(entry)
    shown = f"{value:.6g}" if entry.type == "f32" else f"{value}"
    found = f"{shown} ({axis.current.basis.value})"
    yield Verdict(Grade.OK, server.label, f"current object ({entry.place})", found)


def _judge_constant(place: str, axis: AxisDrive, *, rated: bool) -> Verdict:
    """Compare rated torque, rated current and torque constant; sqrt(2) is rms taken for peak.

    If the drive confirms both ratings (`rated`), the constant or one amplitude is wrong.
    """
    product = expected_torque(axis)
    assert product is not None  # noqa: S101 - the file's validator saw to it
    ratio = product / axis.rated_torque
    confused = (
        min(abs(ratio * root - 1) for root in (math.sqrt(2), math.sqrt(0.5))) < CONSISTENT / 3
    )
    remedy = "look up rated_torque, rated_current, torque_constant in the motor's data sheet"
    if confused:
        remedy = f"a factor of 1.41: rms and peak are confused in one value{_amplitudes(axis)}"
    elif rated and axis.torque_constant is not None:
        remedy = (
            "the drive states the same rated_current and rated_torque, so correct "
            f"torque_constant: {axis.torque_constant / ratio:.4g} N m/A agrees with both"
        )
    return grade_check(
        abs(ratio - 1) <= CONSISTENT,
        Grade.WARNING,
        place,
        "torque constant",
        f"times rated current {product:.4g} N m",
        f"rated torque {axis.rated_torque:g} N m",
        remedy,
    )


def _amplitudes(axis: AxisDrive) -> str:
    """Return the amplitude that would make ratings and torque constant agree, in words."""
    other: dict[str | None, str] = {"rms": "peak", "peak": "rms"}
    stated = axis.torque_constant_amplitude, axis.current.amplitude
    if None in stated:
        return ""
    changed = axis.model_copy(update={"torque_constant_amplitude": other[stated[0]]})
    product = expected_torque(changed)
    if product is None or abs(product / axis.rated_torque - 1) > CONSISTENT:
        return ""
    return (
        f"; torque_constant_amplitude: {other[stated[0]]} or current.amplitude: {other[stated[1]]}"
        " makes them agree: state the one that the data sheet names"
    )


def _judge_gear(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Confirm the gear ratio by 6091, or warn if another 6091 may be an electronic gear.

    A 6091 that contradicts the file with certainty is refused by `consistency.comparisons`.
    """
    factors = PositionFactors.read(server.find)
    check, stated, gear = GEAR, axis.gear_ratio, factors.gear
    if gear is None or gear == 1:
        yield unknown(server.label, check, f"gear_ratio {stated:g} can be seen only in a move")
    elif not list(another_gear(factors, axis)):
        yield grade_check(
            math.isclose(float(gear), stated, rel_tol=SAME_GEAR),
            Grade.WARNING,
            server.label,
            check,
            f"{float(gear):g}",
            f"file: {stated:g}",
            "correct gear_ratio, unless 6091 is an electronic gear of the drive: watch a jog",
        )


COASTS, GOES_ON = "takes the torque away", "does nothing"
_RAMPS = {1: "slows down on the ramp", 2: "slows down on the quick stop ramp"}
_LIMITS = {3: "slows down at the current limit", 4: "slows down at the voltage limit"}
_STAYS = {number + 4: f"{text} and stays powered" for number, text in (_RAMPS | _LIMITS).items()}
_QUICK_STOP = {0: COASTS} | _RAMPS | _LIMITS | _STAYS
_SHUT_DOWN = {0: COASTS, 1: _RAMPS[1]}
_FAULT = {0: COASTS} | _RAMPS | _LIMITS
_CONNECTION = {0: GOES_ON, 1: "goes into a fault", 2: COASTS, 3: "makes a quick stop"}

_FALLS = "the axis coasts, and a hanging axis falls until its brake has closed"
_CONSEQUENCES = {COASTS: _FALLS, GOES_ON: "the axis keeps moving"}
_SET = "set this option with the maker's tool"
_WRITTEN = "hil run overwrites this option, but other masters use this value"


def check_reactions(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Judge the reactions of a drive (see `verdict.Check`)."""
    for entry, check, meanings, when, remedy in (
        (objects.FAULT_REACTION, "fault reaction", _FAULT, "on a fault", _SET),
        (objects.DISABLE_OPTION, "switching off", _SHUT_DOWN, "when it is switched off", _SET),
        (objects.SHUTDOWN_OPTION, "shutting down", _SHUT_DOWN, "when it is shut down", _SET),
        (objects.QUICK_STOP_OPTION, "quick stop", _QUICK_STOP, "at a quick stop", _WRITTEN),
        (objects.ABORT_CONNECTION_OPTION, "lost bus", _CONNECTION, "on loss of the bus", _WRITTEN),
    ):
        present = server.find(entry)
        if present is not None:
            # a warning if the axis would coast or continue
            meaning = meanings.get(present, "specific to the maker, see the drive's manual")
            consequence = _CONSEQUENCES.get(meaning)
            grade = Grade.OK if consequence is None else Grade.WARNING
            advice = "" if consequence is None else f"{when} {consequence}: {remedy}"
            name, found = f"{check} ({entry.index:04X})", f"{present}, {meaning}"
            yield Verdict(grade, server.label, name, found, remedy=advice)
    maker = MAKERS.get(axis.identity.vendor)
    delay = maker.brake_delay if maker else None
    counts = server.find(delay.entry) if delay else None
    if delay and counts:  # not every maker has an object for the closing time of a brake
        yield grade_check(
            delay.value(counts) <= axis.brake_delay * (1 + 1e-9),
            Grade.WARNING,
            server.label,
            f"brake ({delay.entry.place})",
            f"{delay.value(counts):g} s",
            f"file: {axis.brake_delay:g} s",
            "the voltage is removed before the brake has closed: a hanging axis sags; state this "
            "time as brake_delay",
        )
    active = safe_torque_off(server)
    if active:
        remedy = "release safe torque off before you agree to motion: no drive powers on until then"
        yield Verdict(Grade.WARNING, server.label, "interlock", active, remedy=remedy)
    elif server.find(objects.DIGITAL_INPUTS) is not None:
        yield Verdict(Grade.OK, server.label, "interlock (60FD)", "none")


def check_limits(server: RemoteDictionary, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare range, velocity, torque and following error with the file (see `verdict.Check`)."""
    yield _range(server, axis)
    for bound in bounds(axis):
        found = server.find(bound.entry)
        if found is not None:
            own_holds = (
                "the drive's limit is tighter and applies: plan within it, lower "
                f"limits.{bound.key}, correct the unit in the drives file if that is wrong, or "
                "widen it with the maker's tool"
            )
            yield _judge(server.label, bound, found, own_holds)
    key, measure = "following_error_window", measures(axis)[Quantity.DISTANCE]
    window = Bound(objects.FOLLOWING_ERROR_WINDOW, key, axis.following_error_window, measure)
    found = server.find(window.entry)
    if found is not None:
        remedy = f"the drive allows less: lower {key}, or hil run writes the file's value"
        yield _judge(server.label, window, found, remedy)


def _range(server: RemoteDictionary, axis: AxisDrive) -> Verdict:
    check, limits = "software limits (607D)", axis.limits
    ends = [server.find(e) for e in (objects.SOFTWARE_LIMIT_MIN, objects.SOFTWARE_LIMIT_MAX)]
    stated = f"file: [{limits.q_min:.4g}, {limits.q_max:.4g}]"
    low, high = ends
    if wrap_of(range_of(server.find), axis, server.label) is not None:
        kept = "only the driver enforces the axis's range"
        found = "unusable: positions wrap around (607B)"
        return Verdict(Grade.WARNING, server.label, check, found, stated, kept)
    if low is None or high is None:
        return Verdict(
            Grade.REFUSED, server.label, check, "missing", stated, "use a drive with limits"
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
        f"the tighter of both applies, [{q_low_held:.4g}, {q_high_held:.4g}] {axis.unit}: plan "
        "within it, or widen the drive's limits with the maker's tool"
        if overlap
        else "the two do not overlap: correct sign, zero and gear in the drives file",
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
