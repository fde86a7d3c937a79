"""The PDOs that we use: which objects travel in which frame.

Status, position and current must be latched at one SYNC (transmission type 1), so they are best
carried by one TPDO. Where they do not fit into one frame (a current of 32 bits, or a TPDO that
takes two objects) the current goes into TPDO 2 of the same SYNC. `pdo_set_up` writes all that to a
drive, or finds out what a drive with fixed PDOs carries instead. The drives file may state that.

Commands act when they arrive, so that a stop never waits. Set-points of a stream act at the next
SYNC, all at the same instant, whenever the host has sent them within the period: they have an RPDO
of their own, and so has what is fed forward with them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402 import objects
from drivers.commissioning.communication import Refusable
from drivers.commissioning.held_values import mapping_count
from drivers.drives_file import PDO_USES
from drivers.fieldbus import Entry
from drivers.in_node import PDOS

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from drivers.drives_file import AxisDrive

ON_SYNC = 1
ON_EVENT = 255
STATE, COMMAND = (
    (objects.STATUSWORD, objects.POSITION),
    (objects.TARGET_POSITION, objects.CONTROLWORD),
)
"""What a TPDO carries beside the current, and an RPDO: the target, then what makes it valid."""
AT_SYNC = range(241)
"""Transmission types of an RPDO that acts with the next SYNC."""
RPDO_TYPES = (254, 0, 1)
"""On event by the maker's rule, or with the next SYNC."""
LATER = (Entry(0x1801, 2, "u8", "transmission type of TPDO 2"), mapping_count(0x1A01))
"""What is written beside where TPDO 1 turns out to be fixed."""
FURTHEST = Refusable((0x1A00, 3), "if TPDO 1 takes fewer objects")
"""The entry of TPDO 1 that drives with room for two objects refuse."""


class Pdo(NamedTuple):
    """One PDO of a drive as we want it.

    Attributes
    ----------
    name : str
        For messages.
    communication, mapping : int
        Index of its parameter records.
    cob_id : int
        CAN identifier.
    transmission : int
        1 = at every SYNC, 255 = on event.
    also : collection of int
        Transmission types that will do where ours cannot be had.
    entries : tuple of Entry
        What it carries, in order.
    """

    name: str
    communication: int
    mapping: int
    cob_id: int
    transmission: int
    also: Collection[int]
    entries: tuple[Entry, ...]

    @property
    def size(self) -> int:
        """Length of its frame [bytes]."""
        return sum(entry.size for entry in self.entries)

    @property
    def sends(self) -> bool:
        """Whether it comes from the drive."""
        return self.communication >= 0x1800


def transmitted(axis: AxisDrive) -> tuple[Pdo, ...]:
    """Return the TPDOs that carry statusword, position and current, as we would have them."""
    return arrangements(axis)[0]


def arrangements(axis: AxisDrive) -> tuple[tuple[Pdo, ...], ...]:
    """Return how statusword, position and current may be put into TPDOs, the best way first."""
    if axis.tpdos is not None:
        ours = (*STATE, axis.current.entry)
        stated = enumerate(axis.tpdos, start=1)
        return (tuple(_tpdo(n, axis, mapped(words, ours)) for n, words in stated),)
    current = axis.current.entry
    both = (_tpdo(1, axis, STATE), _tpdo(2, axis, (current,)))
    return ((_tpdo(1, axis, (*STATE, current)),), both) if current.size == 2 else (both,)


def answers(axis: AxisDrive) -> tuple[int, ...]:
    """Return all identifiers under which the drive of an axis may answer SYNC."""
    return tuple(_tpdo(number, axis, ()).cob_id for number in (1, 2))


def received(axis: AxisDrive) -> Pdo:
    """Return the RPDO that carries the target, then the controlword that makes it valid."""
    return _rpdo(1, axis, COMMAND)._replace(transmission=ON_EVENT, also=RPDO_TYPES)


def fed_forward(axis: AxisDrive) -> Pdo:
    """Return the RPDO that carries what is fed forward, sent before the target of its cycle."""
    return _rpdo(3, axis, objects.OFFSETS)


def fed_on_arrival(axis: AxisDrive) -> Pdo:
    """Return the same for a drive with two RPDOs, which takes its set-points by RPDO 1."""
    wanted = _rpdo(2, axis, objects.OFFSETS)
    return wanted._replace(transmission=ON_EVENT, also=RPDO_TYPES)


def led(axis: AxisDrive) -> Pdo:
    """Return the RPDO that carries the set-points of a stream."""
    return _rpdo(2, axis, (objects.TARGET_POSITION,))


class Inputs(NamedTuple):
    """The RPDOs of a drive, as they are set up.

    Attributes
    ----------
    command : Pdo
        Target and controlword.
    target : Pdo or None
        Set-points of a stream; `command` where the drive has no other, None where it follows none.
    offsets : Pdo or None
        What is fed forward.
    """

    command: Pdo
    target: Pdo | None
    offsets: Pdo | None = None

    @property
    def synchronous(self) -> bool:
        """Whether set-points, and what is fed forward, act at SYNC."""
        return all(p.transmission in AT_SYNC for p in (self.target, self.offsets) if p is not None)


def mapped(words: Iterable[int], ours: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return the objects that a mapping names; those that are not ours have no name."""
    named = {entry.word: entry for entry in ours}
    return tuple(
        named.get(word) or Entry(word >> 16, word >> 8 & 0xFF, f"u{word & 0xFF}", "")
        for word in words
    )


def _rpdo(number: int, axis: AxisDrive, entries: tuple[Entry, ...]) -> Pdo:
    name, place = f"RPDO {number}", number - 1
    cob_id = _identifier(name, 0x100, number, axis)
    return Pdo(name, 0x1400 + place, 0x1600 + place, cob_id, ON_SYNC, AT_SYNC, entries)


def _tpdo(number: int, axis: AxisDrive, entries: tuple[Entry, ...]) -> Pdo:
    name = f"TPDO {number}"
    cob_id = _identifier(name, 0x80, number, axis)
    return Pdo(name, 0x17FF + number, 0x19FF + number, cob_id, ON_SYNC, (), entries)


def _identifier(name: str, base: int, number: int, axis: AxisDrive) -> int:
    """Return the identifier of a PDO: predefined for the first four of a node, else given."""
    in_node = axis.within.pdos[0] - 1 + number
    if in_node > PDOS and axis.cob_id is not None:
        return axis.cob_id + PDO_USES.index(name)
    return base + 0x100 * in_node + axis.node
