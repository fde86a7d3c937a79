"""PDO set-up by explicit SDO, each step read back.

A mapping may be changed only while its PDO is off: off (bit 31 of the COB-ID), transmission type,
count 0, entries, count n, on. Some drives have fixed PDOs, in part or as a whole; what is fixed is
taken as it is if it already says what we need, and the drive is refused otherwise. An RPDO may also
act on SYNC: set-points and stops then take effect with the next one. Status, position and current
must be latched at one SYNC (transmission type 1). Where they do not fit into one frame (a current
of 32 bits), the current goes into TPDO 2 of the same SYNC.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, NoReturn

from drivers import objects
from drivers.drive_bus import DriveRefused
from drivers.sdo import FIXED_CODES, Aborted, Entry

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive
    from drivers.sdo import SdoServer

OFF = 1 << 31
NO_REMOTE = 1 << 30
ON_SYNC = 1
ON_EVENT = 255
RPDO_TYPES = (254, 0, 1)
"""On event by the maker's rule, or with the next SYNC."""
PDOS = 4


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
    also : tuple of int
        Transmission types that will do where ours cannot be had.
    entries : tuple of Entry
        What it carries, in order.
    """

    name: str
    communication: int
    mapping: int
    cob_id: int
    transmission: int
    also: tuple[int, ...]
    entries: tuple[Entry, ...]

    @property
    def size(self) -> int:
        """Length of its frame [bytes]."""
        return sum(entry.size for entry in self.entries)


def current_entry(axis: AxisDrive) -> Entry:
    """Return the object that holds the axis's motor current or torque."""
    current = axis.current
    return Entry(current.index, current.subindex, current.type, "current readback")


def transmitted(axis: AxisDrive) -> tuple[Pdo, ...]:
    """Return the TPDOs that carry statusword, position and current, in this order."""
    state = (objects.STATUSWORD, objects.POSITION)
    current = current_entry(axis)
    if current.size == 2:
        return (_tpdo(1, axis.node, (*state, current)),)
    return (_tpdo(1, axis.node, state), _tpdo(2, axis.node, (current,)))


def received(axis: AxisDrive) -> Pdo:
    """Return the RPDO that carries the target, then the controlword that makes it valid."""
    entries = (objects.TARGET_POSITION, objects.CONTROLWORD)
    return Pdo("RPDO 1", 0x1400, 0x1600, 0x200 + axis.node, ON_EVENT, RPDO_TYPES, entries)


def set_up_pdos(server: SdoServer, axis: AxisDrive) -> None:
    """Map and switch on what we use, switch off the drive's other TPDOs.

    Raises
    ------
    DriveRefused
        A fixed PDO that carries something else, or a value that reads back differently.
    """
    wanted = transmitted(axis)
    for pdo in (*wanted, received(axis)):
        _set_up(server, pdo)
    for number in range(len(wanted), PDOS):
        _switch_off(server, Entry(0x1800 + number, 1, "u32", f"COB-ID of TPDO {number + 1}"))


def _tpdo(number: int, node: int, entries: tuple[Entry, ...]) -> Pdo:
    cob_id = 0x80 + 0x100 * number + node
    return Pdo(f"TPDO {number}", 0x17FF + number, 0x19FF + number, cob_id, ON_SYNC, (), entries)


def _set_up(server: SdoServer, pdo: Pdo) -> None:
    cob = Entry(pdo.communication, 1, "u32", f"COB-ID of {pdo.name}")
    # Drives differ in whether bit 30 can be changed, so it stays as it is.
    identifier = server.get(cob) & NO_REMOTE | pdo.cob_id
    off = server.set_unless_fixed(cob, identifier | OFF)
    _set_transmission(server, pdo)
    _set_mapping(server, pdo, off=off)
    if server.get(cob) != identifier:
        server.set(cob, identifier)


def _set_transmission(server: SdoServer, pdo: Pdo) -> None:
    kind = Entry(pdo.communication, 2, "u8", f"transmission type of {pdo.name}")
    if server.set_unless_fixed(kind, pdo.transmission) or server.get(kind) in (pdo.transmission, *pdo.also):
        return
    _refuse_fixed(server, kind, f"{server.get(kind)}", f"{pdo.transmission}")


def _set_mapping(server: SdoServer, pdo: Pdo, *, off: bool) -> None:
    try:
        server.set(_count(pdo), 0)
        for entry, value in _entries(pdo):
            server.set(entry, value)
        server.set(_count(pdo), len(pdo.entries))
    except Aborted as error:
        if error.code not in FIXED_CODES and off:
            raise
        _check_fixed(server, pdo)


def _check_fixed(server: SdoServer, pdo: Pdo) -> None:
    content = [*_entries(pdo), (_count(pdo), len(pdo.entries))]
    for entry, value in content:
        present = server.get(entry)
        if present != value:
            _refuse_fixed(server, entry, f"{present:X}h", f"{value:X}h")


def _refuse_fixed(server: SdoServer, entry: Entry, present: str, wanted: str) -> NoReturn:
    raise DriveRefused(
        f"{server.label}: object {entry} is fixed at {present}, {wanted} is needed; "
        "map it with the maker's commissioning tool or use another drive"
    )


def _switch_off(server: SdoServer, cob: Entry) -> None:
    present = server.find(cob)
    if present is not None and not present & OFF:
        server.set(cob, present | OFF)


def _count(pdo: Pdo) -> Entry:
    return Entry(pdo.mapping, 0, "u8", f"number of objects in {pdo.name}")


def _entries(pdo: Pdo) -> list[tuple[Entry, int]]:
    return [
        (
            Entry(pdo.mapping, number, "u32", f"object {number} of {pdo.name}"),
            entry.index << 16 | entry.subindex << 8 | 8 * entry.size,
        )
        for number, entry in enumerate(pdo.entries, start=1)
    ]
