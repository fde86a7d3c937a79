"""Buffer of segmented and block downloads, checked while growing and written when complete."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.canopen.object_dictionary import TEXT_MAX

if TYPE_CHECKING:
    from sim_plant.canopen.eds import Entry


class Served(Protocol):
    """Object dictionary behind an SDO server: of a drive, or of all axes of a node."""

    def upload(self, index: int, subindex: int) -> bytes:
        """Encode the present value."""

    def check_download(self, index: int, subindex: int, size: int | None) -> Entry:
        """Check existence, access and announced length of a write."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Decode and write a value."""


class Incoming:
    """Data of a segmented or block download.

    Parameters
    ----------
    dictionary : Served
    index, subindex : int
    size : int or None
        Length that the client announced.

    Raises
    ------
    SdoAbort
        Unknown or read-only object, or an announced length that does not fit the object.
    """

    def __init__(self, dictionary: Served, index: int, subindex: int, size: int | None) -> None:
        self.index = index
        self.subindex = subindex
        self._dictionary = dictionary
        self._entry = dictionary.check_download(index, subindex, size)
        self._size = size
        self._data = bytearray()

    def add(self, data: bytes) -> None:
        """Append data; refuse more data than the object holds."""
        self._data += data
        if self._entry.code and len(self._data) > self._entry.size:
            raise SdoAbort(AbortCode.LENGTH_HIGH)
        if len(self._data) > TEXT_MAX:
            raise SdoAbort(AbortCode.OUT_OF_MEMORY)

    def finish(self) -> None:
        """Write the object."""
        if self._size is not None and len(self._data) != self._size:
            raise SdoAbort(AbortCode.LENGTH)
        self._dictionary.download(self.index, self.subindex, bytes(self._data))
