"""What a drive says of its motor, encoder and gear against what the drives file states.

Torques are proportional to the rated values, positions to encoder and gear: an error of any of
them is an error of every result of the axis and shows in no residual. So each is read by SDO,
nothing is written, and a contradiction is refused. What a drive does not tell stays on trust, and
that is said too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers import objects
from drivers.drives_file import Basis
from drivers.pdo_mapping import current_entry
from drivers.probing import probed_objects as probed
from drivers.probing.verdict import Grade, Verdict, graded, unknown

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drives_file import AxisDrive
    from drivers.sdo import Entry, SdoServer

SAME = 1e-3
"""Ratios may differ by this share, which is what rounding in a drive comes to."""
CONSISTENT = 0.1
"""Rated torque may differ from torque constant times rated current by this share."""


def check_scaling(server: SdoServer, axis: AxisDrive) -> Iterator[Verdict]:
    """Compare ratings, encoder, gear and units of one drive with the file.

    Parameters
    ----------
    server : SdoServer
        Its object dictionary; only read.
    axis : AxisDrive
        What the drives file states.

    Raises
    ------
    DriveRefused, NodeSilent
        An object that cannot be read.
    """
    yield from _ratings(server, axis)
    if axis.current.basis is not Basis.RATED_TORQUE:
        yield _torque_constant(server.label, axis)
    yield _encoder(server, axis)
    yield _position_unit(server, axis)
    yield _gear(server, axis)
    yield _polarity(server)
    yield _current(server, axis)


def _ratings(server: SdoServer, axis: AxisDrive) -> Iterator[Verdict]:
    for entry, stated, key, unit in (
        (objects.RATED_CURRENT, axis.rated_current, "rated_current", "A"),
        (objects.RATED_TORQUE, axis.rated_torque, "rated_torque", "N m"),
    ):
        check, present = f"{entry.name} ({entry.index:04X})", server.find(entry)
        if present is None:
            yield unknown(server.label, check, f"{key} {stated:g} {unit} is taken on trust")
            continue
        yield graded(
            abs(present - 1000 * stated) <= 1,
            Grade.REFUSED,
            server.label,
            check,
            f"{present / 1000:g} {unit}",
            f"file: {stated:g} {unit}",
            f"correct {key} or the drive's parameter: torques scale with it",
        )


def _torque_constant(place: str, axis: AxisDrive) -> Verdict:
    """Rated torque and rated current must lead to the torque constant: sqrt(2) is rms or peak."""
    assert axis.torque_constant is not None  # noqa: S101 - the file's validator saw to it
    product = axis.torque_constant * axis.rated_current
    if axis.current.amplitude != axis.torque_constant_amplitude:
        product *= math.sqrt(2 if axis.current.amplitude == "rms" else 0.5)
    ratio = product / axis.rated_torque
    confused = (
        min(abs(ratio * root - 1) for root in (math.sqrt(2), math.sqrt(0.5))) < CONSISTENT / 3
    )
    return graded(
        abs(ratio - 1) <= CONSISTENT,
        Grade.WARNING,
        place,
        "torque constant",
        f"times rated current {product:.4g} N m",
        f"rated torque {axis.rated_torque:g} N m",
        "a factor of 1.41: rms and peak are confused in one of them"
        if confused
        else "look all three up in the motor's data sheet",
    )


def _encoder(server: SdoServer, axis: AxisDrive) -> Verdict:
    check, stated = "encoder (608F)", axis.increments_per_revolution
    increments = server.find(objects.ENCODER_INCREMENTS)
    revolutions = server.find(objects.ENCODER_REVOLUTIONS)
    if increments is None or not revolutions:
        return unknown(server.label, check, f"{stated} increments/rev are taken on trust")
    return graded(
        increments == stated * revolutions,
        Grade.REFUSED,
        server.label,
        check,
        f"{increments / revolutions:g} increments/rev",
        f"file: {stated}",
        "correct increments_per_revolution or the drive's parameter",
    )


def _position_unit(server: SdoServer, axis: AxisDrive) -> Verdict:
    """One motor revolution in the drive's position unit: feed over gear (6092, 6091)."""
    check, stated = "position unit (6092/6091)", axis.increments_per_revolution
    feed, gear = _ratio(server, probed.FEED, probed.FEED_SHAFT), _stated_gear(server)
    if feed is None or gear is None:
        return unknown(server.label, check, "one motor increment is taken on trust")
    per_revolution = feed / gear
    return graded(
        math.isclose(per_revolution, stated, rel_tol=SAME),
        Grade.REFUSED,
        server.label,
        check,
        f"{per_revolution:.8g} units per motor revolution",
        f"file: {stated}",
        "set 6091 and 6092 so that positions count motor increments, or state the drive's count",
    )


def _gear(server: SdoServer, axis: AxisDrive) -> Verdict:
    check, stated, gear = "gear (6091)", axis.gear_ratio, _stated_gear(server)
    if gear is None or gear == 1:
        return unknown(server.label, check, f"gear_ratio {stated:g} shows by eye alone, in a move")
    return graded(
        math.isclose(gear, stated, rel_tol=SAME),
        Grade.REFUSED,
        server.label,
        check,
        f"{gear:g}",
        f"file: {stated:g}",
        "correct gear_ratio or the drive's parameter: angles and torques scale with it",
    )


def _polarity(server: SdoServer) -> Verdict:
    present = server.find(probed.POLARITY)
    return graded(
        not present,
        Grade.WARNING,
        server.label,
        "polarity (607E)",
        "not reversed" if not present else f"{present:02X}h",
        "",
        "the drive reverses position or velocity: sign must allow for it, see encoder and current",
    )


def _current(server: SdoServer, axis: AxisDrive) -> Verdict:
    entry = current_entry(axis)
    return Verdict(
        Grade.OK,
        server.label,
        f"current object ({entry.index:04X}:{entry.subindex:02X})",
        f"{server.get(entry)} ({axis.current.basis.value})",
    )


def _stated_gear(server: SdoServer) -> float | None:
    return _ratio(server, probed.GEAR_MOTOR, probed.GEAR_SHAFT)


def _ratio(server: SdoServer, over: Entry, under: Entry) -> float | None:
    numerator, denominator = server.find(over), server.find(under)
    return numerator / denominator if numerator and denominator else None
