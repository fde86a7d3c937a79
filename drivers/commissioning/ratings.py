"""Comparison of motor ratings: rated current and torque (6075, 6076) of drive and drives file.

By the standard 6075 is in mA and 6076 in mN m; some makers state 6076 in uN m. A factor of thousand
scales every torque and every torque limit, so the file states the unit, with two proofs: the value
expected by the file, and rated current times torque constant, which must give the rated torque. The
two need not agree exactly (rms and peak, warm and cold magnets), but never differ by hundreds.
Manufacturer objects of current and constant are compared too.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.objects import MAKERS
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.commissioning.verdict import compare_values, unsettled
from drivers.drives_file import Basis, TorqueUnit

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from drivers.cia402.objects import VendorObject
    from drivers.commissioning.verdict import Comparison
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import Entry

NEWTON_METRE = {TorqueUnit.MILLI: 1e-3, TorqueUnit.MICRO: 1e-6}
"""Size of a unit of 6076 [N m]."""
ROUNDED = 1e-3
"""Largest relative difference of a rated torque in uN m: the file is written by hand."""
ALIKE = 2.0
"""Largest factor between rated torque and torque constant times rated current."""
DISPARATE = 100.0
"""Smallest factor explained only by a different unit."""

_TRUST_CURRENT = REQUIREMENTS[objects.RATED_CURRENT].without
_KEY = "rated_torque"
CURRENT = f"{objects.RATED_CURRENT.name} ({objects.RATED_CURRENT.index:04X})"
TORQUE = f"{objects.RATED_TORQUE.name} ({objects.RATED_TORQUE.index:04X})"
_UNSET, _SET = "0, not configured", "set it with the maker's commissioning tool"
_PRODUCT = "rated torque against rated current"


def compare_ratings(read: Callable[[Entry], int | None], axis: AxisDrive) -> Iterator[Comparison]:
    """Compare the motor ratings in a drive with those of the file.

    Parameters
    ----------
    read : callable
        Returns the value of an object, None if absent.
    axis : AxisDrive
    """
    maker = MAKERS.get(axis.identity.vendor)
    present = read(objects.RATED_CURRENT)
    if present is None and maker is not None:
        counts = read(maker.rated_current.entry)
        yield _current(maker.rated_current.entry, counts or None, axis)
    else:
        yield _current(objects.RATED_CURRENT, present, axis)
    yield _torque(read(objects.RATED_TORQUE), axis)
    if maker is not None and axis.torque_constant is not None:
        counts = read(maker.torque_constant.entry)
        if counts:
            yield _constant(maker.torque_constant, counts, axis.torque_constant)
    if _disparate(axis):
        yield compare_values(
            False,
            _PRODUCT,
            f"{expected_torque(axis):.4g} N m by rated_current times torque_constant",
            _KEY,
            f"{axis.rated_torque:g} N m",
            "an impossible factor: check rated_torque, rated_current and torque_constant in the "
            "motor's data sheet, and state rated_torque_unit: uN m if 6076 is in that unit",
        )


def expected_torque(axis: AxisDrive) -> float | None:
    """Return rated current times torque constant [N m]; None if the file does not state both."""
    if axis.torque_constant is None or axis.current.basis is Basis.RATED_TORQUE:
        return None
    product = axis.torque_constant * axis.rated_current
    if axis.current.amplitude != axis.torque_constant_amplitude:
        product *= math.sqrt(2 if axis.current.amplitude == "rms" else 0.5)
    return product


def torque_unit(present: int, ampere: float, per_ampere: float) -> TorqueUnit | None:
    """Return the unit of 6076 by rated current [A] times torque constant [N m/A].

    Returns
    -------
    TorqueUnit or None
        None if neither unit comes near that product.
    """
    for unit, newton_metre in NEWTON_METRE.items():
        if present and _within(present * newton_metre / (ampere * per_ampere), ALIKE):
            return unit
    return None


def _current(entry: Entry, present: int | None, axis: AxisDrive) -> Comparison:
    check, key = f"{entry.name} ({entry.index:04X})", "rated_current"
    stated = f"{axis.rated_current:g} A"
    if present is None:
        return unsettled(check, f"no object {entry}", key, stated, _TRUST_CURRENT)
    if present == 0 and axis.current.basis is Basis.MILLIAMPERE:
        found = f"{entry} is {_UNSET}"
        return unsettled(check, found, key, stated, _TRUST_CURRENT)
    if present == 0:
        return compare_values(False, check, _UNSET, key, stated, f"base of per mille: {_SET}")
    return compare_values(
        abs(present - 1000 * axis.rated_current) <= 1,
        check,
        f"{present / 1000:g} A",
        key,
        stated,
        f"correct {key} or the drive's parameter: torques scale with it",
    )


def _torque(present: int | None, axis: AxisDrive) -> Comparison:
    stated, unit = f"{axis.rated_torque:g} N m", axis.rated_torque_unit
    if present is None:
        silent = f"no object {objects.RATED_TORQUE}"
        return unsettled(TORQUE, silent, _KEY, stated, REQUIREMENTS[objects.RATED_TORQUE].without)
    if present == 0:
        return compare_values(False, TORQUE, _UNSET, _KEY, stated, f"reference of 6072: {_SET}")
    remedy = f"correct {_KEY} or the drive's parameter: torques scale with it"
    (other,) = set(TorqueUnit) - {unit}
    if _agrees(present, axis.rated_torque, other) and not _disparate(axis):
        remedy = (
            f"as {other.value} it would be {present * NEWTON_METRE[other]:g} N m: state "
            f"rated_torque_unit: {other.value} if the drive's manual says so"
        )
    return compare_values(
        _agrees(present, axis.rated_torque, unit),
        TORQUE,
        f"{present * NEWTON_METRE[unit]:g} N m",
        _KEY,
        stated,
        remedy,
    )


def _constant(quantity: VendorObject, counts: int, stated: float) -> Comparison:
    """Compare the torque constant, which may refer to rms or peak."""
    return compare_values(
        _within(quantity.value(counts) / stated, ALIKE),
        f"{quantity.entry.name} ({quantity.entry.place})",
        f"{quantity.value(counts):g} N m/A",
        "torque_constant",
        f"{stated:g} N m/A",
        "beyond the rms-peak factor 1.41: correct torque_constant or the drive's parameter",
    )


def _agrees(present: int, stated: float, unit: TorqueUnit) -> bool:
    counts = stated / NEWTON_METRE[unit]
    slack = 1.0 if unit is TorqueUnit.MILLI else max(1.0, ROUNDED * counts)
    return abs(present - counts) <= slack * (1 + 1e-9)


def _disparate(axis: AxisDrive) -> bool:
    product = expected_torque(axis)
    return product is not None and not _within(product / axis.rated_torque, DISPARATE)


def _within(ratio: float, factor: float) -> bool:
    return 1 / factor < ratio < factor
