"""Process data exchange of a drive, as found by set-up (`drivers.commissioning`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.commissioning.communication import Communication
from drivers.commissioning.held_values import assignment_slot
from drivers.ethercat.pdo_set_up import (
    ASSIGNED_IN,
    ASSIGNED_OUT,
    BY_FRAMES,
    BY_SYNC0,
    CYCLES,
    MAPPING_IN,
    MAPPING_OUT,
    OFFERS_SYNC0,
    SYNC_TYPES,
    SYNC_TYPES_OFFERED,
    Mapped,
    inputs_of,
    others,
    ours,
    outputs_of,
    set_up_process_data,
)  # fmt: skip
from drivers.ethercat.rules import REQUIREMENTS
from drivers.remote_dictionary import FIXED_CODES, Aborted

if TYPE_CHECKING:
    from typing import Self

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


@dataclass
class EthercatCommunication(Communication):
    """Process data of a drive (see `drivers.commissioning.communication`).

    Attributes
    ----------
    outputs, inputs : Mapped
        Content of the process data, to the drive and from it.
    feed_forward : bool
        True if the drive takes offsets of velocity and torque.
    beside : tuple of (Entry, int)
        Further objects in the outputs, and their values in the drive.
    """

    outputs: Mapped
    inputs: Mapped
    feed_forward: bool = False
    beside: tuple[tuple[Entry, int], ...] = ()

    requirements = REQUIREMENTS
    later = (
        tuple(
            assignment_slot(index, number)
            for index in (ASSIGNED_OUT, ASSIGNED_IN)
            for number in (2, 3)
        )
        + SYNC_TYPES
    )
    """Objects written if mappings turn out to be fixed, and after the search for clocks."""

    @classmethod
    def prefer(cls, axis: AxisDrive, *, feed_forward: bool = False) -> Self:
        """Return the preferred process data of a drive."""
        outputs = ours(MAPPING_OUT, outputs_of(feed_forward=feed_forward))
        return cls(outputs, ours(MAPPING_IN, inputs_of(axis)), feed_forward)

    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Configure cycle time and process data of a drive (see `Communication`)."""
        del drives
        self.set_up_process_data(server, axis)
        for entry in CYCLES:
            if server.find(entry) is not None:
                _set_unless_fixed(server, entry, round(1e9 * period))

    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure the process data only."""
        self.outputs, self.inputs = set_up_process_data(
            server, axis, feed_forward=self.feed_forward
        )
        carried = others(self.outputs, outputs_of(feed_forward=self.feed_forward))
        self.beside = tuple((each, server.find(each) or 0) for each in carried)


def offers_sync0(server: RemoteDictionary) -> bool:
    """Return True if a drive can act and latch at SYNC0."""
    return bool((server.find(SYNC_TYPES_OFFERED) or 0) & OFFERS_SYNC0)


def synchronise(server: RemoteDictionary, *, clocked: bool) -> None:
    """Configure a drive for SYNC0, or for frames, if the synchronisation type is writable."""
    for entry in SYNC_TYPES:
        held = server.find(entry)
        if held in {BY_FRAMES, BY_SYNC0} and held != (wanted := BY_SYNC0 if clocked else BY_FRAMES):
            _set_unless_fixed(server, entry, wanted)


def _set_unless_fixed(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write a value; a drive with a fixed one takes its cycle from the frames."""
    try:
        server.put(entry, value)
    except Aborted as error:
        if error.code not in FIXED_CODES | {0x06010000, 0x08000022}:
            raise
