"""The objects of a drive on the line, as an `Access` (`drivers.remote_dictionary`)."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from drivers.drive_bus import NodeSilent
from drivers.remote_dictionary import AccessRefused, NoAnswer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.ethercat.drive import EthercatDrive


class CoeAccess:
    """The objects of one drive, and its AL state, which is brought to PREOP when first needed.

    Parameters
    ----------
    drive : EthercatDrive
        On the line.
    """

    def __init__(self, drive: EthercatDrive) -> None:
        self.drive = drive

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object (see `drivers.remote_dictionary.Access`)."""
        return self.drive.sdo.upload(index, subindex, size)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object; process data that carry it too carry this value from now on.

        Some drives refuse what they get by process data anyway.
        """
        carried = self.drive.carry(index, subindex, data)
        try:
            self.drive.sdo.download(index, subindex, data)
        except AccessRefused:
            if not carried:
                raise

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object and await no answer."""
        self.drive.order(index, subindex, data)

    def go_operational(self) -> None:
        """Command the drive to exchange process data."""
        with heard(self.drive.label):
            self.drive.go_operational()

    def leave_operational(self) -> None:
        """Command the drive to exchange none."""
        with heard(self.drive.label):
            self.drive.leave_operational()


@contextmanager
def heard(label: str) -> Iterator[None]:
    """Name the drive where it does not answer."""
    try:
        yield
    except NoAnswer as error:
        raise NodeSilent(f"{label}: does not answer ({error}); check {error.where}") from error
