"""What commissioning asks of the bus that a drive is on: how the drive communicates."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.commissioning.requirement import Requirement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


class Refusable(NamedTuple):
    """An object that some drives refuse to have written, after which process data go otherwise.

    Attributes
    ----------
    place : (int, int)
        Its index and sub-index.
    condition : str
        In words, when what follows from that is written.
    """

    place: tuple[int, int]
    condition: str


class Communication(ABC):
    """How one drive exchanges process data and is watched; what set-up finds is put in.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        What a run needs of its object dictionary on this bus.
    feed_forward : bool
        It is to take offsets of velocity and torque.
    later : tuple of Entry
        Objects that may be written after start-up, or where set-up takes another course.
    """

    requirements: ClassVar[Mapping[Entry, Requirement]]
    later: ClassVar[tuple[Entry, ...]]

    @property
    @abstractmethod
    def feed_forward(self) -> bool: ...  # noqa: D102 - an attribute

    def refusable(self, axis: AxisDrive) -> Refusable | None:
        """Return the object that decides on another course, None where there is no other."""
        del axis
        return None

    @abstractmethod
    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Configure it, while the drive is off.

        Raises
        ------
        DriveRefused, NodeSilent
            Why the drive cannot take part.
        """

    @abstractmethod
    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure its process data alone."""
