"""Manufacturer objects for quantities without a standard object, by vendor (1018:01).

Included are only objects named in a maker's dictionary with a unit in the manual; the same index of
another vendor has no meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive


@dataclass(frozen=True, slots=True)
class VendorObject:
    """Manufacturer object, and the size of one count in SI units."""

    entry: Entry
    per_count: float

    def value(self, counts: int) -> float:
        """Convert counts to SI units."""
        return counts * self.per_count


@dataclass(frozen=True, slots=True)
class Maker:
    """Manufacturer objects of a maker's drives.

    Attributes
    ----------
    rated_current : VendorObject
        Rated current of the motor [A].
    torque_constant : VendorObject
        Torque constant of the motor [N m/A].
    brake_delay : VendorObject
        Closing time of the holding brake [s].
    """

    rated_current: VendorObject
    torque_constant: VendorObject
    brake_delay: VendorObject

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Entries of all quantities."""
        quantities = (self.rated_current, self.torque_constant, self.brake_delay)
        return tuple(quantity.entry for quantity in quantities)


MAKERS = {
    0xFB: Maker(  # maxon, EPOS4 and IDX
        rated_current=VendorObject(Entry(0x3001, 1, "u32", "nominal current"), 1e-3),
        torque_constant=VendorObject(Entry(0x3001, 5, "u32", "torque constant"), 1e-6),
        brake_delay=VendorObject(Entry(0x3158, 2, "u16", "holding brake fall time"), 1e-3),
    )
}
"""Makers by vendor identifier."""

VELOCITY_FEED_FORWARDS = {
    0x4D2: Entry(0x2010, 0, "u16", "velocity feed-forward of the position loop")  # the plant's
}
"""Velocity feed-forward gain of a drive, by vendor; 0 for none."""


def own_feed_forward(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return the object of a drive's own feed-forward, if known; ours would add to it."""
    own = VELOCITY_FEED_FORWARDS.get(axis.identity.vendor)
    return () if own is None else (own,)
