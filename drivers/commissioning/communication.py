"""Interface of commissioning to the bus: communication of a drive."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.commissioning.requirements import Requirement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import RemoteDictionary


class Refusable(NamedTuple):
    """Object refused by some drives, with a different mapping as the consequence.

    Attributes
    ----------
    place : (int, int)
        Index and sub-index.
    condition : str
        Condition of the alternative, in words.
    """

    place: tuple[int, int]
    condition: str


class Communication(ABC):
    """Process data exchange and supervision of a drive; completed by set-up.

    Attributes
    ----------
    requirements : mapping of Entry to Requirement
        Requirements on the object dictionary on this bus.
    feed_forward : bool
        True if the drive takes offsets of velocity and torque.
    later : tuple of Entry
        Objects that may be written after start-up, or in an alternative set-up.
    """

    requirements: ClassVar[Mapping[Entry, Requirement]]
    later: ClassVar[tuple[Entry, ...]]

    @property
    @abstractmethod
    def feed_forward(self) -> bool: ...  # noqa: D102 - an attribute

    def refusable(self, axis: AxisDrive) -> Refusable | None:
        """Return the object that decides on an alternative, None if there is none."""
        del axis
        return None

    @abstractmethod
    def set_up(
        self, server: RemoteDictionary, axis: AxisDrive, drives: DrivesFile, period: float
    ) -> None:
        """Configure the communication, while the drive is off.

        Raises
        ------
        DriveRefused, NodeSilent
            The drive cannot take part.
        """

    @abstractmethod
    def set_up_process_data(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        """Configure the process data only."""
