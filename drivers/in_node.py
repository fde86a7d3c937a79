"""Several axes in one node (CiA 402): where an axis finds its own objects and PDOs.

The profile objects of axis k stand 800h times k - 1 after those of the first, and each axis has
PDOs of its own. `AxisAccess` shows the drive as each axis of it would be if it were the only one,
so that all others know a single dictionary: 6041 is the statusword of the axis, TPDO 1 the first
of its own, and mappings name objects likewise. The objects of the first axis stand in exchange
where those of the axis would be.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeVar

from drivers.remote_dictionary import ABSENT, AccessRefused

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.remote_dictionary import Access

AXES = 8
PDOS = 4
"""PDOs that an axis has by default, in each direction."""
_PDOS_OF_PROFILE = 64
"""The same where a drive numbers its PDOs as CiA 402 does."""
_PROFILE, _PER_AXIS = 0x6000, 0x800
_RECORDS, _EACH = range(0x1400, 0x1C00), 0x200
_MAPPING = 0x200
_NO_OBJECT = min(ABSENT)
_Answer = TypeVar("_Answer")


class InNode(NamedTuple):
    """One of several axes of a node.

    Attributes
    ----------
    axis : int
        Which, from 1.
    pdos : tuple of int
        Numbers of its first and its last PDO, in each direction.
    """

    axis: int = 1
    pdos: tuple[int, int] = (1, PDOS)

    def place(self, index: int) -> int | None:
        """Return where the drive has an object of this axis; None where that is another axis's."""
        if index in _RECORDS:
            number = index % _EACH + self.pdos[0]
            return index + self.pdos[0] - 1 if number <= self.pdos[1] else None
        return self._exchanged(index)

    def relative(self, index: int) -> int | None:
        """Return where this axis has an object of the drive; None for PDOs of other axes."""
        if index in _RECORDS:
            inside = self.pdos[0] <= index % _EACH + 1 <= self.pdos[1]
            return index + 1 - self.pdos[0] if inside else None
        return self._exchanged(index)

    def word(self, word: int) -> int:
        """Turn a mapping entry of the axis into the drive's, or the other way round."""
        return self._exchanged(word >> 16) << 16 | word & 0xFFFF

    def _exchanged(self, index: int) -> int:
        block, offset = divmod(index - _PROFILE, _PER_AXIS)
        other = {0: self.axis - 1, self.axis - 1: 0}.get(block, block)
        return _PROFILE + other * _PER_AXIS + offset


ALONE = InNode()
"""The axis of a drive that has no other."""


class AxisAccess:
    """The objects of one axis of a drive (see `drivers.remote_dictionary.Access`).

    Parameters
    ----------
    access : Access
        To the drive.
    within : InNode
        Which axis.
    """

    def __init__(self, access: Access, within: InNode) -> None:
        self._access, self._within = access, within

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object."""
        data = self._asked(index, subindex, lambda i: self._access.read(i, subindex, size))
        return self._word(data) if maps(index, subindex) else data

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object."""
        sent = self._word(data) if maps(index, subindex) else data
        self._asked(index, subindex, lambda i: self._access.write(i, subindex, sent))

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object and await no answer."""
        self._asked(index, subindex, lambda i: self._access.order(i, subindex, data))

    def go_operational(self) -> None:
        """Command the drive to exchange process data."""
        self._access.go_operational()

    def leave_operational(self) -> None:
        """Command the drive to exchange none."""
        self._access.leave_operational()

    def _word(self, data: bytes) -> bytes:
        return self._within.word(int.from_bytes(data, "little")).to_bytes(len(data), "little")

    def _asked(self, index: int, subindex: int, access: Callable[[int], _Answer]) -> _Answer:
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


def seen_by(access: Access, within: InNode) -> Access:
    """Return the access to a drive as one of its axes has it."""
    return access if within == ALONE else AxisAccess(access, within)


def find_axes(has: Callable[[int, int], bool]) -> Sequence[InNode]:
    """Find the axes of a drive and which PDOs are whose.

    Parameters
    ----------
    has : callable
        Whether the drive has an object, by index and sub-index.
    """
    number = 1
    while number < AXES and all(has(i + number * _PER_AXIS, 0) for i in (0x6040, 0x6041)):
        number += 1
    for each in (_PDOS_OF_PROFILE, PDOS):
        firsts = [each * axis + 1 for axis in range(number)]
        if number == 1 or all(has(0x17FF + first, 1) for first in firsts[1:]):
            return [InNode(n, (first, first + PDOS - 1)) for n, first in enumerate(firsts, 1)]
    own = max(1, PDOS // number)
    return [InNode(axis + 1, (axis * own + 1, axis * own + own)) for axis in range(number)]
