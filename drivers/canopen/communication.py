"""How the drives communicate, as commissioning found it, and whether they can share a bus.

Most of it is as we write it. Some is the drive's own: in which order fixed TPDOs carry what we
need, under which identifier emergencies come (1014), which TPDOs cannot be switched off. Nothing of
that hinders, unless two senders claim one identifier: then frames of one are taken for the other's,
set-points included, and both are refused.
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
from drivers.canopen.requirements import REQUIREMENTS
from drivers.canopen.set_up import find_emergency, note_arrival, note_others, set_up_sync
from drivers.canopen.watch_set_up import set_up_watch
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
    """What one drive sends and listens to (see `drivers.commissioning.communication`).

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
        """It is to take offsets of velocity and torque."""
        return self.inputs.offsets is not None

    @classmethod
    def predefined(cls, axis: AxisDrive, *, feed_forward: bool = False) -> Self:
        """Return what a drive does whose communication is as we write it."""
        node, offsets = axis.node, fed_forward(axis) if feed_forward else None
        inputs = Inputs(received(axis), led(axis), offsets)
        return cls(axis.label, node, transmitted(axis), inputs, 0x80 + node)

    requirements = REQUIREMENTS
    later = LATER

    def refusable(self, axis: AxisDrive) -> Refusable | None:
        """Return what drives refuse whose TPDO 1 takes two objects, if there is another way."""
        return FURTHEST if len(arrangements(axis)) > 1 else None

    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Configure how a drive communicates.

        The order is the drive's: it must not produce SYNC when it gets a period to do so, and it
        takes a counter in SYNC only without a period.

        Raises
        ------
        DriveRefused, NodeSilent
            Why the drive cannot take part.
        """
        set_up_sync(server, period)
        self.set_up_process_data(server, axis)
        note_arrival(server, self.inputs)
        note_others(server, self.others, drives.bitrate, period)
        self.emergency = find_emergency(server)
        self.guarded = set_up_watch(server, axis, drives)

    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure the PDOs alone."""
        self.transmitted, self.inputs, self.others = set_up_pdos(
            server, axis, feed_forward=self.feed_forward
        )

    def claims(self, *, first: bool = True) -> Iterator[tuple[int, str]]:
        """Yield the identifiers that it uses, and for what; its node's with its `first` axis."""
        if first:
            yield from self._of_node()
        for pdo in self.transmitted:
            yield pdo.cob_id, f"its {pdo.name}"
        for other in self.others:
            if not other.cob_id & EXTENDED:
                yield other.cob_id & IDENTIFIER, f"its {other.name}, which cannot be switched off"

    def _of_node(self) -> Iterator[tuple[int, str]]:
        node = self.node
        for base, service in (
            (0x580, "the answers of its SDO server"),
            (0x600, "the requests to its SDO server"),
            (0x700, "its heartbeat"),
        ):
            yield base + node, service
        for number in range(1, 5):
            yield 0x100 + 0x100 * number + node, f"its RPDO {number}"
        if self.emergency is not None:
            yield self.emergency, "its emergencies (1014)"


def find_collisions(drives: Sequence[CanopenCommunication], master: int) -> list[DriveRefused]:
    """Return which drives use an identifier that is in use already.

    Parameters
    ----------
    drives : sequence of CanopenCommunication
        All drives on the bus.
    master : int
        Our node number.
    """
    taken = {
        NMT: "by us, for NMT commands",
        SYNC: "by us, for SYNC",
        0x700 + master: "by us, for our heartbeat",
    }
    found, nodes = [], set[int]()
    for drive in drives:
        for identifier, use in drive.claims(first=drive.node not in nodes):
            if identifier in taken:
                found.append(
                    DriveRefused(
                        f"{drive.label}: identifier {identifier:03X}h is used for {use} and, "
                        f"{taken[identifier]}; give one of them another with the maker's "
                        "commissioning tool"
                    )
                )
            taken.setdefault(identifier, f"by {drive.label}, for {use}")
        nodes.add(drive.node)
    return found
