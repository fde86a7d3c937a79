"""How the drives communicate, as commissioning found it, and whether they can share a bus.

Most of it is as we write it. Some is the drive's own: in which order fixed TPDOs carry what we
need, under which identifier emergencies come (1014), which TPDOs cannot be switched off. Nothing of
that hinders, unless two senders claim one identifier: then frames of one are taken for the other's,
set-points included, and both are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.canopen.pdo_mapping import Inputs, fed_forward, led, received, transmitted
from drivers.cia402.states import Mode
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Self

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.canopen.pdo_set_up import OtherTpdo
    from drivers.drives_file import AxisDrive

SYNC, NMT = 0x80, 0x00
EXTENDED = 1 << 29
IDENTIFIER = 0x7FF
ON_REQUEST = (252, 253)
LAST_SYNCHRONOUS = 240


@dataclass(slots=True)
class Communication:
    """What one drive sends and listens to.

    Attributes
    ----------
    label : str
        How messages name the drive.
    node : int
        Its node number.
    transmitted : tuple of Pdo
        The TPDOs that answer SYNC, with all that they carry, in order.
    inputs : Inputs
        The RPDOs that command it.
    emergency : int or None
        Identifier of its emergencies; None where it sends none.
    others : tuple of OtherTpdo
        TPDOs that we do not use and that go on.
    guarded : bool
        It watches our guarding requests instead of our heartbeat.
    mode : Mode
        In which it moves: profile position, or cyclic position, in which the driver plans.
    """

    label: str
    node: int
    transmitted: tuple[Pdo, ...]
    inputs: Inputs
    emergency: int | None
    others: tuple[OtherTpdo, ...] = field(default=())
    guarded: bool = False
    mode: Mode = Mode.PROFILE_POSITION

    @property
    def feed_forward(self) -> bool:
        """It is to take offsets of velocity and torque."""
        return self.inputs.offsets is not None

    @classmethod
    def predefined(cls, axis: AxisDrive, label: str, *, feed_forward: bool = False) -> Self:
        """Return what a drive does whose communication is as we write it."""
        node, offsets = axis.node, fed_forward(axis) if feed_forward else None
        inputs = Inputs(received(axis), led(axis), offsets)
        return cls(label, node, transmitted(axis), inputs, 0x80 + node)

    def claims(self) -> Iterator[tuple[int, str]]:
        """Yield the identifiers that it uses, and for what."""
        node = self.node
        for base, service in (
            (0x580, "the answers of its SDO server"),
            (0x600, "the requests to its SDO server"),
            (0x700, "its heartbeat"),
        ):
            yield base + node, service
        for number in range(1, 5):
            yield 0x100 + 0x100 * number + node, f"its RPDO {number}"
        for pdo in self.transmitted:
            yield pdo.cob_id, f"its {pdo.name}"
        if self.emergency is not None:
            yield self.emergency, "its emergencies (1014)"
        for other in self.others:
            if not other.cob_id & EXTENDED:
                yield other.cob_id & IDENTIFIER, f"its {other.name}, which cannot be switched off"


def find_collisions(drives: Sequence[Communication], master: int) -> list[DriveRefused]:
    """Return which drives use an identifier that is in use already.

    Parameters
    ----------
    drives : sequence of Communication
        All drives on the bus.
    master : int
        Our node number.
    """
    taken = {
        NMT: "by us, for NMT commands",
        SYNC: "by us, for SYNC",
        0x700 + master: "by us, for our heartbeat",
    }
    found = []
    for drive in drives:
        for identifier, use in drive.claims():
            if identifier in taken:
                found.append(
                    DriveRefused(
                        f"{drive.label}: identifier {identifier:03X}h is used for {use} and, "
                        f"{taken[identifier]}; give one of them another with the maker's "
                        "commissioning tool"
                    )
                )
            taken.setdefault(identifier, f"by {drive.label}, for {use}")
    return found
