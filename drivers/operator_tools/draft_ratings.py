"""Motor ratings in a draft of a drives file.

Rated current and torque constant come from 6075 and from manufacturer objects. They also show the
unit of the rated torque in a drive: mN m by the standard, uN m with some makers. If nothing proves
the unit and the standard's reading would be an impossible motor, value and unit are left to be
stated.
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
"""Upper bound of torque constants of robots' motors [N m/A]."""


def draft_ratings(dictionary: Dictionary) -> dict[str, Drafted]:
    """Return the motor ratings by key of the drives file, with values or hints."""
    maker = MAKERS.get(dictionary.vendor or 0)
    present = dictionary.value(objects.RATED_CURRENT)
    hint = "rated current of the motor [A], which the drive's per mille refer to"
    hint += default_of(dictionary, objects.RATED_CURRENT)
    if present:
        current = Drafted(f"{present / 1000:g}", "A, 6075", hint)
    else:
        own = _read_own(dictionary, maker.rated_current if maker else None, "A")
        current = own or Drafted(None, "", hint + also_named(dictionary, "rated_current"))
    hint = "motor torque over current [N m/A], from the motor's data sheet"
    hint += also_named(dictionary, "torque_constant")
    own = _read_own(dictionary, maker.torque_constant if maker else None, "N m/A")
    constant = own or Drafted(None, "", hint)
    torque, unit = _rated_torque(dictionary, current, constant)
    return {
        "rated_current": current,
        "rated_torque": torque,
        "rated_torque_unit": unit,
        "torque_constant": constant,
    }


def _read_own(dictionary: Dictionary, own: VendorObject | None, unit: str) -> Drafted | None:
    """Return the configured value of a manufacturer object."""
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
    elif dictionary.vendor in MAKERS or (
        current.value and present / 1000 / float(current.value) > CONSTANT_MAX
    ):
        unit = None
    else:
        unit = TorqueUnit.MILLI
    if unit is None:
        # value and unit are left to be stated
        readings = ", ".join(
            f"{present * newton_metre:.4g} N m if it is in {unit.value}"
            for unit, newton_metre in NEWTON_METRE.items()
        )
        hint += f"; 6076 is {present}: {readings}{also_named(dictionary, 'torque_constant')}"
        choice = (
            "unit of 6076 in the drive, mN m or uN m: rated current times torque constant decides"
        )
        return Drafted(None, "", hint), Drafted(None, "", choice)
    value = f"{present * NEWTON_METRE[unit]:.10g}"
    if unit is TorqueUnit.MILLI:
        return Drafted(value, "N m, 6076", ""), standard
    product = float(current.value or 0) * float(constant.value or 0)
    proof = (
        f"of 6076 = {present}: {current.value} {current.reason}, times {constant.value}"
        f" {constant.reason}, is {product:.4g} N m"
    )
    return Drafted(value, "N m, 6076", ""), Drafted(unit.value, proof, "")
