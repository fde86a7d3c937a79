"""PDOs used by the driver, and their objects.

Status, position and current must be latched at one SYNC (transmission type 1), preferably in one
TPDO. If they do not fit (a current of 32 bits, or a TPDO with room for two objects), the current
goes into TPDO 2 of the same SYNC. `pdo_set_up` writes the PDOs to a drive, or reads the mapping of
fixed PDOs, which the drives file may state.

Commands act on arrival, so that a stop never waits. Streamed set-points act at the next SYNC, all
at the same instant, whenever the host has sent them within the period: they have an RPDO of their
own, and so have feed-forward offsets.
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
"""Objects of the TPDO besides the current, and of the RPDO: target before controlword."""
AT_SYNC = range(241)
"""Transmission types of an RPDO with action at the next SYNC."""
RPDO_TYPES = (254, 0, 1)
"""Accepted types for commands: event-driven (manufacturer), or at the next SYNC."""
LATER = (Entry(0x1801, 2, "u8", "transmission type of TPDO 2"), mapping_count(0x1A01))
"""Objects also written if TPDO 1 turns out to be fixed."""
FURTHEST = Refusable((0x1A00, 3), "if TPDO 1 is smaller")
"""Entry of TPDO 1 refused by drives with room for two objects."""


class Pdo(NamedTuple):
    """PDO of a drive, as preferred or as set up.

    Attributes
    ----------
    name : str
        Name in messages.
    communication, mapping : int
        Index of the parameter records.
    cob_id : int
        CAN identifier.
    transmission : int
        1 = at every SYNC, 255 = on event.
    also : collection of int
        Transmission types accepted if `transmission` is impossible.
    entries : tuple of Entry
        Mapped objects, in order.
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
        """Length of the frame [bytes]."""
        return sum(entry.size for entry in self.entries)

    @property
    def sends(self) -> bool:
        """True for a TPDO."""
        return self.communication >= 0x1800


def transmitted(axis: AxisDrive) -> tuple[Pdo, ...]:
    """Return the preferred TPDOs with statusword, position and current."""
    return arrangements(axis)[0]


def arrangements(axis: AxisDrive) -> tuple[tuple[Pdo, ...], ...]:
    """Return the possible TPDOs with statusword, position and current, best first."""
    if axis.tpdos is not None:
        ours = (*STATE, axis.current.entry)
        stated = enumerate(axis.tpdos, start=1)
        return (tuple(_tpdo(n, axis, mapped(words, ours)) for n, words in stated),)
    current = axis.current.entry
    both = (_tpdo(1, axis, STATE), _tpdo(2, axis, (current,)))
    return ((_tpdo(1, axis, (*STATE, current)),), both) if current.size == 2 else (both,)


def answers(axis: AxisDrive) -> tuple[int, ...]:
    """Return the identifiers of possible answers to SYNC from an axis."""
    return tuple(_tpdo(number, axis, ()).cob_id for number in (1, 2))


def received(axis: AxisDrive) -> Pdo:
    """Return the RPDO with target and, after it, the controlword that makes the target valid."""
    return _rpdo(1, axis, COMMAND)._replace(transmission=ON_EVENT, also=RPDO_TYPES)


def fed_forward(axis: AxisDrive) -> Pdo:
    """Return the RPDO with feed-forward offsets, sent before the target of its cycle."""
    return _rpdo(3, axis, objects.OFFSETS)


def fed_on_arrival(axis: AxisDrive) -> Pdo:
    """Return the feed-forward RPDO of a drive with two RPDOs and set-points in RPDO 1."""
    wanted = _rpdo(2, axis, objects.OFFSETS)
    return wanted._replace(transmission=ON_EVENT, also=RPDO_TYPES)


def led(axis: AxisDrive) -> Pdo:
    """Return the RPDO with streamed set-points."""
    return _rpdo(2, axis, (objects.TARGET_POSITION,))


class Inputs(NamedTuple):
    """RPDOs of a drive, as set up.

    Attributes
    ----------
    command : Pdo
        Target and controlword.
    target : Pdo or None
        Streamed set-points; `command` where the drive has no other RPDO, None without streaming.
    offsets : Pdo or None
        Feed-forward offsets.
    """

    command: Pdo
    target: Pdo | None
    offsets: Pdo | None = None

    @property
    def synchronous(self) -> bool:
        """True if set-points and feed-forward act at SYNC."""
        return all(p.transmission in AT_SYNC for p in (self.target, self.offsets) if p is not None)


def mapped(words: Iterable[int], ours: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return the objects of a mapping; objects other than ours get no name."""
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
    """Return the identifier of a PDO: predefined for the first four of a node, else assigned."""
    in_node = axis.within.pdos[0] - 1 + number
    if in_node > PDOS and axis.cob_id is not None:
        return axis.cob_id + PDO_USES.index(name)
    return base + 0x100 * in_node + axis.node
