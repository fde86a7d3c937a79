"""Communication of the drives as found in commissioning, and conflicts on a shared bus.

Most settings are written by us. Some belong to the drive: the order of objects in fixed TPDOs, the
identifier of emergencies (1014), TPDOs that cannot be switched off. These are harmless unless two
senders use one identifier: frames of one are then mistaken for the other's, set-points included,
and both drives are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.canopen.objects import EXTENDED, IDENTIFIER, NMT, SYNC
from drivers.canopen.pdo_mapping import (
    FURTHEST,
    LATER,
    Inputs,
    arrangements,
    fed_forward,
    led,
    received,
    transmitted,
)
from drivers.canopen.pdo_set_up import set_up_pdos
from drivers.canopen.rules import REQUIREMENTS
from drivers.canopen.set_up import (
    find_emergency,
    note_arrival,
    note_others,
    set_up_sync,
    set_up_watch,
)
from drivers.commissioning.communication import Communication
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Self

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.canopen.pdo_set_up import OtherTpdo
    from drivers.commissioning.communication import Refusable
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.remote_dictionary import RemoteDictionary


@dataclass
class CanopenCommunication(Communication):
    """Frames of a drive, sent and received (see `drivers.commissioning.communication`).

    Attributes
    ----------
    label : str
        Name of the drive in messages.
    node : int
        Node number.
    transmitted : tuple of Pdo
        TPDOs that answer SYNC, with their entire content, in order.
    inputs : Inputs
        RPDOs with commands.
    emergency : int or None
        Identifier of emergencies; None if the drive sends none.
    others : tuple of OtherTpdo
        Unused TPDOs that cannot be switched off.
    guarded : bool
        True if the drive supervises our guarding requests instead of our heartbeat.
    """

    label: str
    node: int
    transmitted: tuple[Pdo, ...]
    inputs: Inputs
    emergency: int | None
    others: tuple[OtherTpdo, ...] = field(default=())
    guarded: bool = False

    @property
    def feed_forward(self) -> bool:
        """True if the drive takes offsets of velocity and torque."""
        return self.inputs.offsets is not None

    @classmethod
    def predefined(cls, axis: AxisDrive, *, feed_forward: bool = False) -> Self:
        """Return the communication of a drive with the preferred settings."""
        node, offsets = axis.node, fed_forward(axis) if feed_forward else None
        inputs = Inputs(received(axis), led(axis), offsets)
        return cls(axis.label, node, transmitted(axis), inputs, 0x80 + node)

    requirements = REQUIREMENTS
    later = LATER

    def refusable(self, axis: AxisDrive) -> Refusable | None:
        """Return the entry refused by a TPDO 1 with room for two objects, if two TPDOs suffice."""
        return FURTHEST if len(arrangements(axis)) > 1 else None

    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Configure the communication of a drive (see `Communication`).

        The order matters: a drive must not produce SYNC when it gets a period, and its SYNC counter
        can be changed only without a period.
        """
        set_up_sync(server, period)
        self.set_up_process_data(server, axis)
        note_arrival(server, self.inputs)
        note_others(server, self.others, drives.bitrate, period)
        self.emergency = find_emergency(server)
        self.guarded = set_up_watch(server, axis, drives)

    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure the PDOs only."""
        self.transmitted, self.inputs, self.others = set_up_pdos(
            server, axis, feed_forward=self.feed_forward
        )

    def claims(self, *, first: bool = True) -> Iterator[tuple[int, str]]:
        """Yield used identifiers and their purpose; for the `first` axis also those of the node."""
        if first:
            for base, service in (
                (0x580, "the answers of its SDO server"),
                (0x600, "the requests to its SDO server"),
                (0x700, "its heartbeat"),
            ):
                yield base + self.node, service
            for number in range(1, 5):
                yield 0x100 + 0x100 * number + self.node, f"its RPDO {number}"
            if self.emergency is not None:
                yield self.emergency, "its emergencies (1014)"
        for pdo in self.transmitted:
            yield pdo.cob_id, f"its {pdo.name}"
        for other in self.others:
            if not other.cob_id & EXTENDED:
                yield other.cob_id & IDENTIFIER, f"its {other.name}, which cannot be switched off"


def find_collisions(drives: Sequence[CanopenCommunication], master: int) -> list[DriveRefused]:
    """Return an error for each drive that uses an identifier already in use.

    Parameters
    ----------
    drives : sequence of CanopenCommunication
        Drives on the bus.
    master : int
        Our node number.
    """
    taken = {
        NMT: "by this program, for NMT commands",
        SYNC: "by this program, for SYNC",
        0x700 + master: "by this program, for its heartbeat",
    }
    found, nodes = [], set[int]()
    for drive in drives:
        for identifier, use in drive.claims(first=drive.node not in nodes):
            if identifier in taken:
                found.append(
                    DriveRefused(
                        f"{drive.label}: identifier {identifier:03X}h is used for {use} and, "
                        f"{taken[identifier]}; give one of the two another identifier with the "
                        "maker's commissioning tool"
                    )
                )
            taken.setdefault(identifier, f"by {drive.label}, for {use}")
        nodes.add(drive.node)
    return found
