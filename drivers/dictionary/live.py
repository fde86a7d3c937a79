"""Reading of a live drive's object dictionary, object by object, without writing.

A drive denies an object with a specific abort code. Any other failure (no answer, an access
forbidden in its state) proves nothing, and is kept as such. A drive with several unanswered objects
is not read any further, so that a scan ends in bounded time.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from checked_files.foreign_text import one_line
from drivers.cia402 import objects
from drivers.cia402.objects import MAKERS
from drivers.commissioning.held_values import mapping_slot
from drivers.dictionary.dictionary import Declared, Dictionary, Key, mark_mapped
from drivers.remote_dictionary import ABSENT, AccessRefused, NoAnswer, axis_suffix

if TYPE_CHECKING:
    from drivers.dictionary.review import BusRules
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import Access

DEVICE_NAME = 0x1008
WRITE_ONLY, NO_DATA = 0x06010001, 0x08000024
PATIENCE = 5
"""Largest number of unanswered objects."""
MAPPED = 8
"""Number of mapping entries to read."""
TEXT_LIMIT = 60

_CURRENTS = (objects.TORQUE, objects.CURRENT)


def read_dictionary(access: Access, node: int, rules: BusRules, axis: int = 1) -> Dictionary:
    """Read the objects for a review from a drive.

    Parameters
    ----------
    access : Access
    node : int
        Node number.
    rules : BusRules
        Rules of the bus.
    axis : int
        Number of the axis in the node.
    """
    reading = _Reading(access)
    for entry in (*rules.requirements, *_CURRENTS, *rules.asked):
        reading.ask(entry)
    maker = MAKERS.get(reading.value(objects.VENDOR) or 0)
    for entry in maker.entries if maker else ():
        reading.ask(entry)
    for mapping in rules.mappings:
        count = reading.entries.get((mapping, 0))
        for number in range(1, min((count and count.value) or 0, MAPPED) + 1):
            reading.ask(mapping_slot(mapping, number))
    model = reading.text(DEVICE_NAME)
    identity = [reading.value(entry) for entry in objects.IDENTITY]
    return Dictionary(
        f"node {node}{axis_suffix(axis)}",
        live=True,
        entries=mark_mapped(reading.entries),
        unanswered=reading.unanswered,
        node=node,
        vendor=identity[0],
        product=identity[1],
        revision=identity[2],
        serial=identity[3],
        model=model,
    )


@dataclass
class _Reading:
    """Intermediate state of reading a dictionary."""

    access: Access
    entries: dict[Key, Declared] = field(default_factory=dict)
    unanswered: dict[Key, str] = field(default_factory=dict)
    silences: int = 0

    def ask(self, entry: Entry) -> None:
        """Read a number, once."""
        key = entry.key
        if key in self.entries or key in self.unanswered:
            return
        if self.silences >= PATIENCE:
            self.unanswered[key] = "was not asked for any more"
            return
        try:
            data = self.access.read(*key, entry.size)
        except AccessRefused as error:
            key, code = entry.key, error.code
            if code == WRITE_ONLY:
                self.entries[key] = Declared(*key, entry.name, entry.type, access="wo")
            elif code == NO_DATA:  # present and empty, as a history (1003) without errors
                self.entries[key] = Declared(*key, entry.name, entry.type)
            elif code not in ABSENT:
                self.unanswered[key] = f"was refused with {code:08X} ({error})"
        except NoAnswer:
            self.silences += 1
            self.unanswered[key] = "was not answered"
        else:
            # the drive's length may differ from the standard
            kind = f"{entry.type[0]}{8 * len(data)}" if 0 < len(data) <= 8 else None
            value = int.from_bytes(data, "little", signed=entry.signed) if kind else None
            self.entries[key] = Declared(*key, entry.name, kind, value=value)

    def value(self, entry: Entry) -> int | None:
        """Return the value read, None if there is none."""
        found = self.entries.get(entry.key)
        return None if found is None else found.value

    def text(self, index: int) -> str:
        """Read a name; empty if absent."""
        if self.silences >= PATIENCE:
            return ""
        try:
            data = self.access.read(index, 0)
        except (AccessRefused, NoAnswer):
            return ""
        return one_line(data[:TEXT_LIMIT].decode("latin-1").strip("\0 "))
