"""Multi-axis nodes (CiA 402): objects and PDOs of an axis within its node.

The profile objects of axis k lie 800h (k - 1) above those of the first axis, and the PDOs of the
node are divided among the axes. `AxisAccess` shows the drive as if an axis were the only one,
so that callers know a single dictionary: 6041 is the statusword of the axis, TPDO 1 its first
TPDO, and mappings name objects likewise. The objects of the first axis and of the axis shown
change places.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

from drivers.remote_dictionary import ABSENT, AccessRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.remote_dictionary import Access

AXES = 8
PDOS = 4
"""Default number of PDOs of an axis, in each direction."""
_PDOS_OF_PROFILE = 64
"""Number of PDOs of an axis where a drive numbers PDOs as in CiA 402."""
_PROFILE, _PER_AXIS = 0x6000, 0x800
_RECORDS, _EACH = range(0x1400, 0x1C00), 0x200
_MAPPING = 0x200
_NO_OBJECT = min(ABSENT)
_Answer = TypeVar("_Answer")


class InNode(NamedTuple):
    """Axis within a node, and the PDOs that belong to the axis.

    Attributes
    ----------
    axis : int
        Number of the axis, from 1.
    pdos : tuple of int
        Numbers of the first and the last PDO, in each direction.
    """

    axis: int = 1
    pdos: tuple[int, int] = (1, PDOS)

    def place(self, index: int) -> int | None:
        """Return the index in the drive of an object of this axis; None beyond its PDOs."""
        if index in _RECORDS:
            number = index % _EACH + self.pdos[0]
            return index + self.pdos[0] - 1 if number <= self.pdos[1] else None
        return self._exchange(index)

    def relative(self, index: int) -> int | None:
        """Return the index in this axis of an object of the drive; None for PDOs of other axes."""
        if index in _RECORDS:
            inside = self.pdos[0] <= index % _EACH + 1 <= self.pdos[1]
            return index + 1 - self.pdos[0] if inside else None
        return self._exchange(index)

    def word(self, word: int) -> int:
        """Convert a mapping entry from the axis to the drive, or back."""
        return self._exchange(word >> 16) << 16 | word & 0xFFFF

    def _exchange(self, index: int) -> int:
        block, offset = divmod(index - _PROFILE, _PER_AXIS)
        other = {0: self.axis - 1, self.axis - 1: 0}.get(block, block)
        return _PROFILE + other * _PER_AXIS + offset


ALONE = InNode()
"""The only axis of a drive."""


class AxisAccess:
    """Objects of an axis of a drive (see `drivers.remote_dictionary.Access`).

    Parameters
    ----------
    access : Access
    within : InNode
        Axis within the node.
    """

    def __init__(self, access: Access, within: InNode) -> None:
        self._access, self._within = access, within

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object."""
        data = self._request(index, subindex, lambda i: self._access.read(i, subindex, size))
        return self._word(data) if maps(index, subindex) else data

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""
        sent = self._word(data) if maps(index, subindex) else data
        self._request(index, subindex, lambda i: self._access.write(i, subindex, sent))

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object without waiting for an answer."""
        self._request(index, subindex, lambda i: self._access.order(i, subindex, data))

    def go_operational(self) -> None:
        """Command the drive to start the exchange of process data."""
        self._access.go_operational()

    def leave_operational(self) -> None:
        """Command the drive to stop the exchange of process data."""
        self._access.leave_operational()

    def _word(self, data: bytes) -> bytes:
        return self._within.word(int.from_bytes(data, "little")).to_bytes(len(data), "little")

    def _request(self, index: int, subindex: int, access: Callable[[int], _Answer]) -> _Answer:
        place = self._within.place(index)
        if place is None:
            raise AccessRefused(_NO_OBJECT, "a PDO of another axis of this drive")
        try:
            return access(place)
        except AccessRefused as error:
            words = f"{error}; on the bus it is {place:04X}:{subindex:02X}"
            raise AccessRefused(error.code, words) from error


def maps(index: int, subindex: int) -> bool:
    """Return True for an entry of a PDO mapping."""
    return index in _RECORDS and bool(index & _MAPPING and subindex)


def show_axis(access: Access, within: InNode) -> Access:
    """Return the access to the objects of an axis of a drive."""
    return access if within == ALONE else AxisAccess(access, within)


def find_axes(has: Callable[[int, int], bool]) -> Sequence[InNode]:
    """Find the axes of a drive and the PDOs of each.

    Parameters
    ----------
    has : callable
        Returns True if the drive has an object, by index and sub-index.
    """
    number = 1
    while number < AXES and all(has(i + number * _PER_AXIS, 0) for i in (0x6040, 0x6041)):
        number += 1
    # PDOs in blocks of 64 or of 4 per axis if the drive has them, else its first 4 are divided
    for each in (_PDOS_OF_PROFILE, PDOS):
        firsts = [each * axis + 1 for axis in range(number)]
        if number == 1 or all(has(0x17FF + first, 1) for first in firsts[1:]):
            return [InNode(n, (first, first + PDOS - 1)) for n, first in enumerate(firsts, 1)]
    own = max(1, PDOS // number)
    return [InNode(axis + 1, (axis * own + 1, axis * own + own)) for axis in range(number)]
