"""The drive profile's objects: what the settings put in, what values they take, what they show."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim_plant.cia402_node import Cia402Node
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.object_dictionary import ObjectDictionary

PROFILE_POSITION = 1
_U32_MAX = 0xFFFF_FFFF

_ALLOWED = {
    0x605A: (0, 1, 2, 3, 5, 6, 7),
    0x6060: (PROFILE_POSITION,),
}

_MEASURED = {0x6064: 0, 0x606C: 1, 0x6077: 2, 0x6078: 3, 0x6062: 4, 0x60F4: 5}
"""Objects that show a field of `sim_plant.axis.Reading`, in the order of its fields."""


def declare(dictionary: ObjectDictionary, settings: DriveSettings) -> None:
    """Put identity, ratings and limits of one drive into its dictionary."""
    for (index, subindex), value in _presets(settings).items():
        dictionary.preset(index, subindex, value)
    for index in (0x6072, 0x6073):
        dictionary.limit(index, 0, 0, settings.max_torque)
    for index, values in _ALLOWED.items():
        dictionary.allow(index, values)


def present(dictionary: ObjectDictionary, node: Cia402Node) -> None:
    """Let the dictionary show what the drive measures and does."""
    dictionary.source(0x6041, 0, lambda: node.statusword)
    for index, field in _MEASURED.items():
        dictionary.source(index, 0, functools.partial(_measured, node, field))
    dictionary.source(0x6061, 0, lambda: dictionary.get(0x6060))
    dictionary.source(0x6063, 0, functools.partial(_measured, node, 0))
    dictionary.imaged((0x6041, *_MEASURED), lambda: (node.statusword, *node.row))


def _measured(node: Cia402Node, field: int) -> int:
    return node.row[field]


def _presets(settings: DriveSettings) -> dict[tuple[int, int], int | bytes]:
    counts = settings.increments_per_revolution
    motor, shaft = settings.gear
    low, high = settings.software_limits
    return {
        (0x1018, 1): settings.vendor_id,
        (0x1018, 2): settings.product_code,
        (0x1018, 3): settings.revision,
        (0x1018, 4): settings.serial,
        (0x2000, 0): settings.name.encode("ascii", "replace"),
        (0x6072, 0): settings.max_torque,
        (0x6073, 0): settings.max_torque,
        (0x6075, 0): settings.rated_current,
        (0x6076, 0): settings.rated_torque,
        (0x607D, 1): low,
        (0x607D, 2): high,
        (0x607F, 0): min(_U32_MAX, settings.max_motor_speed * counts // 60),
        (0x6080, 0): settings.max_motor_speed,
        (0x608F, 1): counts,
        (0x608F, 2): 1,
        (0x6091, 1): motor,
        (0x6091, 2): shaft,
        # position unit = motor increment: feed per shaft revolution in increments
        (0x6092, 1): counts * motor,
        (0x6092, 2): shaft,
        (0x60C5, 0): settings.max_acceleration,
        (0x60C6, 0): settings.max_acceleration,
    }
