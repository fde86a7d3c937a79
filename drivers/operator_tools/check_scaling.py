"""Check of a drive's motor, encoder and gear against the drives file.

Torques are proportional to the rated values, positions to encoder and gear: an error of these is an
error of every result of the axis and shows in no residual. So each is read by SDO, nothing is
written, and a contradiction is refused. Values not stated by a drive are taken on trust, with a
remark.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.commissioning.consistency import GEAR, SAME_GEAR, another_gear, comparisons
from drivers.commissioning.position_units import PositionFactors
from drivers.commissioning.ratings import CURRENT, TORQUE, expected_torque
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
        "the drive reverses position or velocity: sign must allow for it, see encoder and current",
    )
    entry = axis.current.entry
    value = server.measure(entry)
    shown = f"{value:.6g}" if entry.type == "f32" else f"{value}"
    found = f"{shown} ({axis.current.basis.value})"
    yield Verdict(Grade.OK, server.label, f"current object ({entry.place})", found)


def _judge_constant(place: str, axis: AxisDrive, *, rated: bool) -> Verdict:
    """Compare rated torque, rated current and torque constant; sqrt(2) means rms or peak.

    If the drive confirms both ratings (`rated`), the constant or one amplitude is wrong.
    """
    product = expected_torque(axis)
    assert product is not None  # noqa: S101 - the file's validator saw to it
    ratio = product / axis.rated_torque
    confused = (
        min(abs(ratio * root - 1) for root in (math.sqrt(2), math.sqrt(0.5))) < CONSISTENT / 3
    )
    remedy = "look all three up in the motor's data sheet"
    if confused:
        remedy = f"a factor of 1.41: rms and peak are confused in one of them{_amplitudes(axis)}"
    elif rated and axis.torque_constant is not None:
        remedy = (
            "the drive states the same rated_current and rated_torque, so correct torque_constant:"
            f" {axis.torque_constant / ratio:.4g} N m/A leads from one to the other"
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
    """Judge a gear: confirmed, or on trust, since without a feed it may be the drive's own.

    A contradiction is among the comparisons.
    """
    factors = PositionFactors.read(server.find)
    check, stated, gear = GEAR, axis.gear_ratio, factors.gear
    if gear is None or gear == 1:
        yield unknown(server.label, check, f"gear_ratio {stated:g} shows by eye alone, in a move")
    elif not list(another_gear(factors, axis)):
        yield grade_check(
            math.isclose(float(gear), stated, rel_tol=SAME_GEAR),
            Grade.WARNING,
            server.label,
            check,
            f"{float(gear):g}",
            f"file: {stated:g}",
            "an electronic gear of the drive, or correct gear_ratio: it shows by eye, in a move",
        )
