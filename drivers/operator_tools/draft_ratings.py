"""The motor's ratings as a draft of a drives file states them, or asks for them.

Rated current and torque constant come from 6075 and from makers' own objects. They also show
in what unit a drive states its rated torque: mN m by the standard, uN m with some makers. Where
nothing proves it and the standard's reading would be a motor that nobody builds, value and unit are
left to be stated.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.vendor_objects import MAKERS
from drivers.commissioning.ratings import NEWTON_METRE, torque_unit
from drivers.drives_file import TorqueUnit
from drivers.operator_tools.draft_hints import Drafted, also_named, default_of

if TYPE_CHECKING:
    from drivers.cia402.vendor_objects import VendorObject
    from drivers.dictionary.dictionary import Dictionary

CONSTANT_MAX = 20.0
"""Torque constants of robots' motors are far below [N m/A]."""


def drafted_ratings(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return the lines of a draft on a motor's ratings, by key, each with its value or a hint."""
    maker = MAKERS.get(dictionary.vendor or 0)
    current = _rated_current(dictionary, maker.rated_current if maker else None)
    constant = _torque_constant(dictionary, maker.torque_constant if maker else None)
    torque, unit = _rated_torque(dictionary, current, constant)
    return {
        "rated_current": current,
        "rated_torque": torque,
        "rated_torque_unit": unit,
        "torque_constant": constant,
    }


def _rated_current(dictionary: Dictionary, own: VendorObject | None) -> Drafted:
    present = dictionary.value(objects.RATED_CURRENT)
    hint = "rated current of the motor [A], which the drive's per mille refer to"
    hint += default_of(dictionary, objects.RATED_CURRENT)
    if present:
        return Drafted(f"{present / 1000:g}", "A, 6075", hint)
    return _own(dictionary, own, "A") or Drafted(
        None, "", hint + also_named(dictionary, "rated_current")
    )


def _torque_constant(dictionary: Dictionary, own: VendorObject | None) -> Drafted:
    hint = "motor torque over current [N m/A], from the motor's data sheet"
    hint += also_named(dictionary, "torque_constant")
    return _own(dictionary, own, "N m/A") or Drafted(None, "", hint)


def _own(dictionary: Dictionary, own: VendorObject | None, unit: str) -> Drafted | None:
    """What a maker's own object is configured to."""
    counts = dictionary.value(own.entry) if own else None
    if own is None or not counts:
        return None
    return Drafted(f"{own.value(counts):.10g}", f"{unit}, {own.entry.place}", "")


def _rated_torque(
    dictionary: Dictionary, current: Drafted, constant: Drafted
) -> tuple[Drafted, Drafted]:
    present = dictionary.value(objects.RATED_TORQUE)
    hint = "rated torque of the motor [N m], which the drive's per mille refer to"
    standard = Drafted(TorqueUnit.MILLI.value, "6076", "")
    if not present:
        hint += default_of(dictionary, objects.RATED_TORQUE)
        return Drafted(None, "", hint + also_named(dictionary, "rated_torque")), standard
    if current.value and constant.value:
        unit = torque_unit(present, float(current.value), float(constant.value))
    elif dictionary.vendor in MAKERS or _unlikely(present, current):
        unit = None
    else:
        unit = TorqueUnit.MILLI
    if unit is None:
        return _either(dictionary, present, hint)
    value = f"{present * NEWTON_METRE[unit]:.10g}"
    if unit is TorqueUnit.MILLI:
        return Drafted(value, "N m, 6076", ""), standard
    return (
        Drafted(value, "N m, 6076", ""),
        Drafted(unit.value, f"of 6076 = {present}: {_product(current, constant)}", ""),
    )


def _unlikely(present: int, current: Drafted) -> bool:
    """Whether the standard's unit would make a motor that nobody builds."""
    return bool(current.value) and present / 1000 / float(current.value or 1) > CONSTANT_MAX


def _either(dictionary: Dictionary, present: int, hint: str) -> tuple[Drafted, Drafted]:
    """Leave value and unit to be stated."""
    readings = ", ".join(
        f"{present * newton_metre:.4g} N m if it is in {unit.value}"
        for unit, newton_metre in NEWTON_METRE.items()
    )
    hint += f"; 6076 is {present}: {readings}{also_named(dictionary, 'torque_constant')}"
    choice = "unit of 6076 in the drive, mN m or uN m: rated current times torque constant decides"
    return Drafted(None, "", hint), Drafted(None, "", choice)


def _product(current: Drafted, constant: Drafted) -> str:
    product = float(current.value or 0) * float(constant.value or 0)
    return (
        f"{current.value} {current.reason}, times {constant.value} {constant.reason}, is "
        f"{product:.4g} N m"
    )
