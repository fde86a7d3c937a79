"""What is read of a drive for the settings that are kept of it.

Before an object is first written, its value; once start-up has written, the values that the drive
kept; and where an earlier session was killed, whether its values are still those of the drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.pdo_mapping import mapping_count, mapping_slot
from drivers.canopen.sdo import Aborted
from drivers.found_settings.settings_file import COMMANDS, WRITTEN_ONCE, FoundDrive, FoundObject

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.fieldbus import Entry

MAPPINGS = (range(0x1600, 0x1800), range(0x1A00, 0x1C00))
ENTRIES_MAX = 64
"""Most objects in a PDO (CiA 301)."""


def before(server: RemoteDictionary, entry: Entry) -> dict[Entry, int]:
    """Read what must be kept before `entry` is written, beside what `server` has kept already.

    Of commands and of what is missing that is nothing. The objects of a PDO mapping belong
    together: whoever changes one loses them all.

    Raises
    ------
    NodeSilent, DriveRefused
        No answer, or another length than expected.
    """
    if entry.index in COMMANDS:
        return {}
    entries: Sequence[Entry] = [entry]
    if any(entry.index in mappings for mappings in MAPPINGS):
        entries = [*_mapped(server, entry.index), entry]
    fresh = {(each.index, each.subindex): each for each in entries}
    values = {e: _read(server, e) for place, e in fresh.items() if place not in server.saved}
    return {each: value for each, value in values.items() if value is not None}


def standing(server: RemoteDictionary, earlier: FoundDrive) -> FoundDrive:
    """Take what an earlier session found, but the drive's value where it has been set up anew."""
    objects = []
    for each in earlier.objects:
        present = None if each.written is None else _read(server, each.entry)
        update = {"written": present}
        if present is not None and each.set_anew(present):
            server.note(f"{each.comparison(present)} and stands")
            update["value"] = present
        objects.append(each.model_copy(update=update))
    return earlier.model_copy(update={"objects": tuple(objects)})


def with_planned(drive: FoundDrive, planned: Mapping[Entry, int]) -> FoundDrive:
    """Add what a drive will hold, for a session that is killed during start-up."""
    values = {(entry.index, entry.subindex): value for entry, value in planned.items()}
    objects = tuple(
        each.model_copy(update={"written": values.get(each.place, each.written)})
        if each.index in WRITTEN_ONCE
        else each
        for each in drive.objects
    )
    return drive.model_copy(update={"objects": objects})


def with_written(server: RemoteDictionary, each: FoundObject) -> FoundObject:
    """Add what a drive holds once start-up has written to it, if that is to stay."""
    if each.index not in WRITTEN_ONCE:
        return each
    return each.model_copy(update={"written": _read(server, each.entry)})


def _mapped(server: RemoteDictionary, index: int) -> list[Entry]:
    count = mapping_count(index)
    present = min(_read(server, count) or 0, ENTRIES_MAX)
    return [count, *(mapping_slot(index, n) for n in range(1, present + 1))]


def _read(server: RemoteDictionary, entry: Entry) -> int | None:
    try:
        return server.get(entry)
    except Aborted:  # missing or write-only: the write itself will say what is wrong with it
        return None


def extended(drive: FoundDrive, found: Mapping[Entry, int]) -> FoundDrive:
    """Add values to those that are kept of a drive; what is kept already stays."""
    places = {each.place for each in drive.objects}
    objects = tuple(
        FoundObject.model_validate(
            {
                "index": entry.index,
                "subindex": entry.subindex,
                "type": entry.type,
                "value": value,
                "name": entry.name,
            }
        )
        for entry, value in found.items()
        if (entry.index, entry.subindex) not in places
    )
    return drive.model_copy(update={"objects": (*drive.objects, *objects), "restored": False})
