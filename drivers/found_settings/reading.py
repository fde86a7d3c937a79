"""What is read of a drive for the settings that are kept of it.

Once start-up has written, the values that the drive kept; and where an earlier session was killed,
whether its values are still those of the drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.commissioning.held_values import read_if_held
from drivers.found_settings.settings_file import WRITTEN_ONCE, FoundDrive, FoundObject

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.fieldbus import Entry


def standing(server: RemoteDictionary, earlier: FoundDrive) -> FoundDrive:
    """Take what an earlier session found, but the drive's value where it has been set up anew."""
    objects = []
    for each in earlier.objects:
        present = None if each.written is None else read_if_held(server, each.entry)
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
    return each.model_copy(update={"written": read_if_held(server, each.entry)})


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
