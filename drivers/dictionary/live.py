"""What a live drive's object dictionary holds, asked object by object and without writing.

A drive denies an object with an abort code that says so. Whatever else keeps it from answering (no
answer, an access that its state forbids) proves nothing, and is kept as such. A drive that leaves
several objects unanswered is not asked on, so that a scan ends in bounded time.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError, SdoError

from drivers.canopen import objects as cia301
from drivers.canopen.network import PumpedSdoClient
from drivers.canopen.pdo_mapping import mapping_count, mapping_slot
from drivers.canopen.sdo import ABSENT
from drivers.canopen.vendor_objects import MAKERS
from drivers.cia402 import objects
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.dictionary.dictionary import Declared, Dictionary, Key
from drivers.dictionary.mapping_review import mapped_objects
from drivers.fieldbus import Entry

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.canopen.network import PumpedNetwork

DEVICE_NAME = 0x1008
WRITE_ONLY, NO_DATA = 0x06010001, 0x08000024
PATIENCE = 5
"""So many objects may stay without an answer."""
MAPPED = 8
"""Mapping entries that are looked at."""
TEXT_LIMIT = 60
EXCHANGES = 64
"""Longest answer that is waited for [frames of 7 bytes]."""

_CURRENTS = (
    objects.TORQUE,
    Entry(0x6078, 0, "i16", "current actual value"),
)


def asked() -> Iterator[Entry]:
    """Yield the objects that a drive is asked for, the decisive ones first."""
    yield from REQUIREMENTS
    yield from _CURRENTS
    for record in (0x1400, 0x1800, 0x1801):
        yield Entry(record, 1, "u32", "COB-ID")
        yield Entry(record, 2, "u8", "transmission type")
        yield mapping_count(record + 0x200)


def read_dictionary(network: PumpedNetwork, node: int, timeout: float) -> Dictionary:
    """Read from a drive what a review needs.

    Parameters
    ----------
    network : PumpedNetwork
        The network that the drive is on.
    node : int
        Its node number.
    timeout : float
        How long each answer may take [s].
    """
    reading = _Reading(_BriefClient(network, node, timeout))
    for entry in asked():
        reading.ask(entry)
    maker = MAKERS.get(reading.value(cia301.VENDOR) or 0)
    for entry in maker.entries if maker else ():
        reading.ask(entry)
    for mapping in (0x1600, 0x1A00, 0x1A01):
        count = reading.entries.get((mapping, 0))
        for number in range(1, min((count and count.value) or 0, MAPPED) + 1):
            reading.ask(mapping_slot(mapping, number))
    model = reading.text(DEVICE_NAME)
    identity = [reading.value(entry) for entry in cia301.IDENTITY]
    proved = mapped_objects(reading.entries)
    return Dictionary(
        f"node {node}",
        live=True,
        entries={
            key: replace(found, mappable=True) if key in proved else found
            for key, found in reading.entries.items()
        },
        unanswered=reading.unanswered,
        node=node,
        vendor=identity[0],
        product=identity[1],
        revision=identity[2],
        serial=identity[3],
        model=model,
    )


class _BriefClient(PumpedSdoClient):
    """Gives up on an answer without end."""

    exchanges = 0

    def upload(self, index: int, subindex: int) -> bytes:
        """Read an object, as canopen does."""
        self.exchanges = 0
        data: bytes = super().upload(index, subindex)
        return data

    def request_response(self, sdo_request: bytes) -> bytes:
        """Send a request and wait for its answer, unless there were too many already."""
        self.exchanges += 1
        if self.exchanges > EXCHANGES:
            raise SdoCommunicationError(f"no end after {EXCHANGES} frames")
        return super().request_response(sdo_request)


@dataclass
class _Reading:
    """A dictionary half read."""

    client: PumpedSdoClient
    entries: dict[Key, Declared] = field(default_factory=dict)
    unanswered: dict[Key, str] = field(default_factory=dict)
    silences: int = 0

    def ask(self, entry: Entry) -> None:
        """Read one number, once."""
        key = (entry.index, entry.subindex)
        if key in self.entries or key in self.unanswered:
            return
        if self.silences >= PATIENCE:
            self.unanswered[key] = "was not asked for any more"
            return
        try:
            data = self.client.upload_number(*key, entry.size)
        except SdoAbortedError as error:
            self._denied(entry, error.code)
        except SdoError:
            self.silences += 1
            self.unanswered[key] = "was not answered"
        else:
            self.entries[key] = _declared(entry, data)

    def _denied(self, entry: Entry, code: int) -> None:
        key = (entry.index, entry.subindex)
        if code == WRITE_ONLY:
            self.entries[key] = Declared(*key, entry.name, entry.type, access="wo")
        elif code == NO_DATA:  # it is there and empty, as a history (1003) without errors
            self.entries[key] = Declared(*key, entry.name, entry.type)
        elif code not in ABSENT:
            what = SdoAbortedError.CODES.get(code, "unknown abort code")
            self.unanswered[key] = f"was refused with {code:08X} ({what})"

    def value(self, entry: Entry) -> int | None:
        """Return what was read, None where nothing was."""
        found = self.entries.get((entry.index, entry.subindex))
        return None if found is None else found.value

    def text(self, index: int) -> str:
        """Read a name; empty where there is none."""
        if self.silences >= PATIENCE:
            return ""
        try:
            data: bytes = self.client.upload(index, 0)
        except SdoError:
            return ""
        text = data[:TEXT_LIMIT].decode("latin-1").strip("\0 ")
        return "".join(letter if letter.isprintable() else "?" for letter in text)


def _declared(entry: Entry, data: bytes) -> Declared:
    """Take a value in the length that the drive gives it, which may differ from the standard."""
    kind = f"{entry.type[0]}{8 * len(data)}" if 0 < len(data) <= 8 else None
    value = int.from_bytes(data, "little", signed=entry.signed) if kind else None
    return Declared(entry.index, entry.subindex, entry.name, kind, value=value)
