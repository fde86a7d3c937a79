"""Mailboxes and process data areas in a slave's EEPROM (SII, ETG.1000.6 clause 5.4)."""

from __future__ import annotations

import struct
import time
from typing import TYPE_CHECKING, NamedTuple

from drivers.drive_bus import DriveRefused
from drivers.ethercat import registers as reg
from drivers.remote_dictionary import NoAnswer

if TYPE_CHECKING:
    from drivers.ethercat.slaves import Station

_MAILBOXES, _PROTOCOLS, _CATEGORIES = 0x18, 0x1C, 0x40
"""Word addresses: standard mailboxes, protocols, first category."""
_COE = 0x04
_MANAGERS, _END = 41, 0xFFFF
_CATEGORIES_MAX = 64
"""Largest number of categories, so that reading a damaged EEPROM ends."""
_BUSY, _FAILED = 0x8000, 0x2800
_READ = 0x0100
_TIME = 0.5
"""Longest duration of a read [s]; hardware takes 0.3 ms."""
_MANAGER = struct.Struct("<HHBBBB")
MAILBOX_LEAST = 32
"""Smallest mailbox for SDO [bytes]: 6 of header, 2 of CoE, 8 for an expedited value."""


class Area(NamedTuple):
    """Part of a slave's memory under a sync manager.

    Attributes
    ----------
    start, size : int
        Address, and length [bytes].
    control : int
        First control byte of the sync manager.
    """

    start: int
    size: int
    control: int


class Layout(NamedTuple):
    """Memory layout of a slave: mailboxes out and in, outputs, inputs."""

    mailbox_out: Area
    mailbox_in: Area
    outputs: Area
    inputs: Area


def read_layout(station: Station) -> Layout:
    """Read the memory layout of a slave.

    Raises
    ------
    DriveRefused
        The slave has no CoE, or no sync managers for process data.
    NoAnswer, BusUnavailable
        See `Station.read`.
    """
    station.write(reg.EEPROM_OWNER, b"\0")
    try:
        return _layout(station)
    finally:
        station.write(reg.EEPROM_OWNER, b"\1")


def _layout(station: Station) -> Layout:
    out, out_size, back, back_size = struct.unpack("<4H", _words(station, _MAILBOXES, 4))
    protocols = int.from_bytes(_words(station, _PROTOCOLS, 2)[:2], "little")
    if not protocols & _COE or min(out_size, back_size) < MAILBOX_LEAST:
        raise DriveRefused(
            f"slave {station.position}: no CANopen over EtherCAT by its EEPROM (protocols"
            f" {protocols:04X}h, mailboxes of {out_size} and {back_size} bytes), so it is not a"
            " CiA 402 drive; check its place on the line"
        )
    managers = _managers(station)
    if len(managers) < 4:
        raise DriveRefused(
            f"slave {station.position}: its EEPROM names {len(managers)} sync managers, process"
            " data need 4; have its maker's tool write the EEPROM anew"
        )
    return Layout(
        Area(out, out_size, managers[0].control or 0x26),
        Area(back, back_size, managers[1].control or 0x22),
        managers[2],
        managers[3],
    )


def _managers(station: Station) -> list[Area]:
    word = _CATEGORIES
    for _ in range(_CATEGORIES_MAX):
        kind, size = struct.unpack_from("<HH", _words(station, word, 2))
        if kind == _END:
            break
        if kind == _MANAGERS:
            data = b"".join(_words(station, word + 2 + n, 4) for n in range(0, min(size, 32), 4))
            return [
                Area(start, length, control)
                for start, length, control, *_ in _MANAGER.iter_unpack(data[: 2 * size // 8 * 8])
            ]
        word += 2 + size
    return []


def _words(station: Station, word: int, count: int) -> bytes:
    """Read words in blocks of two."""
    data = b""
    while len(data) < 2 * count:
        station.write(reg.EEPROM_ADDRESS, (word + len(data) // 2).to_bytes(4, "little"))
        station.put_word(reg.EEPROM_CONTROL, _READ)
        ends = time.monotonic() + _TIME
        while (status := station.word(reg.EEPROM_CONTROL)) & _BUSY:
            if time.monotonic() > ends:
                raise NoAnswer(f"EEPROM busy for {_TIME:g} s", "its supply")
            station.line.pause()
        if status & _FAILED:
            raise NoAnswer(f"EEPROM status {status:04X}h", "the EEPROM with the maker's tool")
        data += station.read(reg.EEPROM_DATA, 4)
    return data[: 2 * count]
