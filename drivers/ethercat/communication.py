"""How one drive exchanges process data, as set-up found it (`drivers.commissioning`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.commissioning.communication import Communication
from drivers.commissioning.held_values import assignment_slot
from drivers.ethercat.objects import (
    ASSIGNED_IN,
    ASSIGNED_OUT,
    BY_FRAMES,
    BY_SYNC0,
    CYCLES,
    OFFERS_SYNC0,
    SYNC_TYPES,
    SYNC_TYPES_OFFERED,
)
from drivers.ethercat.pdo_set_up import MAPPING_IN, MAPPING_OUT, others, set_up_process_data
from drivers.ethercat.process_layout import Mapped, inputs_of, ours, outputs_of
from drivers.ethercat.requirements import REQUIREMENTS
from drivers.remote_dictionary import FIXED_CODES, Aborted

if TYPE_CHECKING:
    from typing import Self

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


@dataclass
class EthercatCommunication(Communication):
    """What one drive sends and is sent (see `drivers.commissioning.communication`).

    Attributes
    ----------
    outputs, inputs : Mapped
        What process data carry, to the drive and from it.
    feed_forward : bool
        It is to take offsets of velocity and torque.
    beside : tuple of (Entry, int)
        What else outputs carry, and what the drive held of it.
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
    """What is written where mappings turn out to be fixed, and once it is known who has a clock."""

    @classmethod
    def wanted(cls, axis: AxisDrive, *, feed_forward: bool = False) -> Self:
        """Return what a drive exchanges whose process data are as we write them."""
        outputs = ours(MAPPING_OUT, outputs_of(feed_forward=feed_forward))
        return cls(outputs, ours(MAPPING_IN, inputs_of(axis)), feed_forward)

    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Have the drive know its cycle and exchange what we need.

        Raises
        ------
        DriveRefused, NodeSilent
            Why the drive cannot take part.
        """
        del drives
        self.set_up_process_data(server, axis)
        for entry in CYCLES:
            if server.find(entry) is not None:
                _set_unless_fixed(server, entry, round(1e9 * period))

    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure process data alone."""
        self.outputs, self.inputs = set_up_process_data(
            server, axis, feed_forward=self.feed_forward
        )
        carried = others(self.outputs, outputs_of(feed_forward=self.feed_forward))
        self.beside = tuple((each, server.find(each) or 0) for each in carried)


def offers_sync0(server: RemoteDictionary) -> bool:
    """Whether a drive can act and latch at SYNC0."""
    return bool((server.find(SYNC_TYPES_OFFERED) or 0) & OFFERS_SYNC0)


def synchronise(server: RemoteDictionary, *, clocked: bool) -> None:
    """Have a drive act and latch at SYNC0, or as frames come, where it is written what it does."""
    for entry in SYNC_TYPES:
        held = server.find(entry)
        if held in {BY_FRAMES, BY_SYNC0} and held != (wanted := BY_SYNC0 if clocked else BY_FRAMES):
            _set_unless_fixed(server, entry, wanted)


def _set_unless_fixed(server: RemoteDictionary, entry: Entry, value: int) -> None:
    """Write a cycle time; where it cannot be written the drive takes it from the frames."""
    try:
        server.put(entry, value)
    except Aborted as error:
        if error.code not in FIXED_CODES | {0x06010000, 0x08000022}:
            raise
