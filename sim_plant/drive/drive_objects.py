"""The drive profile's objects: what the settings put in, what values they take, what they show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.drive.process_image import STATUSWORD

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings

PROFILE_POSITION = 1
_U32_MAX = 0xFFFF_FFFF

_ALLOWED = {
    0x605A: (0, 1, 2, 3, 5, 6, 7),
    0x6060: (PROFILE_POSITION,),
}

_SHOWN = {
    0x6064: 0,
    0x6063: 0,
    0x606C: 1,
    0x6077: 2,
    0x6078: 3,
    0x6062: 4,
    0x60F4: 5,
    0x6041: STATUSWORD,
}


def declare(dictionary: ObjectDictionary, settings: DriveSettings) -> None:
    """Put identity, ratings and limits of one drive into its dictionary."""
    for (index, subindex), value in _presets(settings).items():
        dictionary.preset(index, subindex, value)
    for index in (0x6072, 0x6073):
        dictionary.limit(index, 0, 0, settings.max_torque)
    for index, values in _ALLOWED.items():
        dictionary.allow(index, values)


def present(dictionary: ObjectDictionary, image: AxisImage) -> None:
    """Let the dictionary show what the drive measures and does.

    Parameters
    ----------
    dictionary : ObjectDictionary
    image : AxisImage
        Where they stand.
    """
    slots = {index: image.slot(field) for index, field in _SHOWN.items()}
    dictionary.imaged(slots, image.values)
    dictionary.source(0x6061, 0, lambda: dictionary.get(0x6060))


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
