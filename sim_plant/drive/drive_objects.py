"""Objects of the drive profile: presets from the settings, permitted values, measured values."""

from __future__ import annotations

import struct
from functools import partial
from typing import TYPE_CHECKING

from sim_plant.canopen.eds import key
from sim_plant.drive.process_image import STATUSWORD
from sim_plant.drive.units import Turns, Units

if TYPE_CHECKING:
    from sim_plant.canopen.object_dictionary import ObjectDictionary
    from sim_plant.drive.process_image import AxisImage
    from sim_plant.drive_settings import DriveSettings

_U32_MAX = 0xFFFF_FFFF
_QUICK_STOP_OPTIONS = (0, 1, 2, 3, 5, 6, 7)
_POSITION, _VELOCITY, _CURRENT, _DEMAND = 0, 1, 3, 4

_SHOWN = {
    0x6064: _POSITION,
    0x6063: 0,
    0x606C: _VELOCITY,
    0x6077: 2,
    0x6062: _DEMAND,
    0x60F4: 5,
    0x6041: STATUSWORD,
}


def declare(dictionary: ObjectDictionary, settings: DriveSettings) -> None:
    """Write identity, ratings and limits of a drive to its dictionary."""
    changed = settings.personality.objects
    own = {(change.index, change.subindex) for change in changed if change.default is not None}
    for (index, subindex), value in _presets(settings).items():
        if (index, subindex) not in own:
            dictionary.preset(index, subindex, value)
    for index in (0x6072, 0x6073):
        dictionary.limit(index, 0, 0, settings.max_torque)
    dictionary.allow(0x605A, _QUICK_STOP_OPTIONS)
    if 0x6084 in settings.personality.missing:
        dictionary.source(0x6084, 0, lambda: dictionary.get(0x6083))


def present(dictionary: ObjectDictionary, image: AxisImage, settings: DriveSettings) -> None:
    """Connect the dictionary to the measured values of the drive.

    Parameters
    ----------
    dictionary : ObjectDictionary
    image : AxisImage
        Present values of the axis.
    settings : DriveSettings
        Object of the current, and unit of velocities.
    """
    slots = {key(index): image.slot(field) for index, field in _SHOWN.items()}
    current, unit = settings.personality.current, Units.derive(settings).velocity
    if current is not None and current.type != "f32":
        slots[key(current.index, current.subindex)] = image.slot(_CURRENT)
    turns, wrapped = Turns.derive(settings), (0x6064, 0x6062)
    wrapping = {index: slots.pop(key(index)) for index in wrapped} if turns.size else {}
    dictionary.imaged(slots, image.values)
    for index, slot in wrapping.items():
        dictionary.source(index, 0, partial(_shown, turns, image, slot))
    if current is not None and current.type == "f32":
        shown = image.slot(_CURRENT)

        def bits() -> int:
            ampere = struct.pack("<f", image.values.item(shown) / 1000)
            return int.from_bytes(ampere, "little")

        dictionary.source(current.index, current.subindex, bits)
    if unit != 1:
        velocity = image.slot(_VELOCITY)
        dictionary.source(0x606C, 0, lambda: round(image.values.item(velocity) / unit))


def _shown(turns: Turns, image: AxisImage, slot: int) -> int:
    return turns.shown(image.values.item(slot))


def _presets(settings: DriveSettings) -> dict[tuple[int, int], int | bytes]:
    units = Units.derive(settings)
    counts = float(settings.counts_per_revolution)
    speed = int(settings.max_motor_speed * counts / 60 / units.velocity)
    acceleration = min(_U32_MAX, int(settings.max_acceleration / units.acceleration))
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
        (0x607F, 0): min(_U32_MAX, speed),
        (0x6080, 0): settings.max_motor_speed,
        (0x608F, 1): settings.increments_per_revolution,
        (0x608F, 2): 1,
        (0x6091, 1): motor,
        (0x6091, 2): shaft,
        (0x6092, 1): settings.feed[0],
        (0x6092, 2): settings.feed[1],
        (0x6085, 0): acceleration,
        (0x60C5, 0): acceleration,
        (0x60C6, 0): acceleration,
    }
