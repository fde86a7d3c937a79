"""Objects of makers' own that say what the standard has no object for, by vendor (1018:01).

Only what a maker's dictionary names and its manual gives a unit to stands here; nothing is
concluded from an object of another vendor at the same place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive


@dataclass(frozen=True, slots=True)
class VendorObject:
    """A maker's object and what one count of it is in SI units."""

    entry: Entry
    per_count: float

    def value(self, counts: int) -> float:
        """Return so many counts in SI units."""
        return counts * self.per_count


@dataclass(frozen=True, slots=True)
class Maker:
    """What a maker's drives say beyond the standard.

    Attributes
    ----------
    rated_current : VendorObject
        Of the motor [A].
    torque_constant : VendorObject
        Of the motor [N m/A].
    brake_delay : VendorObject
        Time that the holding brake takes to close [s].
    """

    rated_current: VendorObject
    torque_constant: VendorObject
    brake_delay: VendorObject

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All of them."""
        quantities = (self.rated_current, self.torque_constant, self.brake_delay)
        return tuple(quantity.entry for quantity in quantities)


MAKERS = {
    0xFB: Maker(  # maxon, EPOS4 and IDX
        rated_current=VendorObject(Entry(0x3001, 1, "u32", "nominal current"), 1e-3),
        torque_constant=VendorObject(Entry(0x3001, 5, "u32", "torque constant"), 1e-6),
        brake_delay=VendorObject(Entry(0x3158, 2, "u16", "holding brake fall time"), 1e-3),
    )
}
"""By vendor."""

VELOCITY_FEED_FORWARDS = {
    0x4D2: Entry(0x2010, 0, "u16", "velocity feed-forward of the position loop"),  # the plant's
}
"""By vendor: how much of a demand's velocity the drive feeds forward by itself, 0 for nothing."""


def own_feed_forward(axis: AxisDrive) -> tuple[Entry, ...]:
    """Return the object of a drive's own feed-forward, which ours would double; none if unknown."""
    own = VELOCITY_FEED_FORWARDS.get(axis.identity.vendor)
    return () if own is None else (own,)
