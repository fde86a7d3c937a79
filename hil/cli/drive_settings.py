"""Terminal output of changes to drives' settings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from drivers.commissioning.announcement import announce
from drivers.drive_bus import DriveError, DriveRefused
from drivers.found_settings.keeping import SettingsKeeper
from hil.terminal.console import out, say

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import Entry
    from drivers.session.connection import Fieldbus


def show_changes(drives: DrivesFile, bus: Fieldbus, keeper: SettingsKeeper) -> None:
    """List the pending changes of a session to the drives; nothing is written.

    Raises
    ------
    DriveError
        Drives that cannot serve, a line each, after the others' tables.
    """
    keeper.open(drives)
    problems: list[DriveError] = []
    unpowered, period = bus.unpowered(drives), drives.sync_period
    for server, axis, communication in zip(
        unpowered.servers, drives.axes, unpowered.communications, strict=True
    ):
        held = partial(keeper.found, server)
        try:
            found = announce(server, axis, drives, period, communication, held)
        except DriveError as error:
            problems.append(error)
            continue
        changes = [(each.entry, each.present, each.value) for each in found.changes]
        show_changed(server.label, changes, "to be written")
        for note in found.limits.notes:
            say(f"{server.label}: {note}", style="yellow")
    if problems:
        raise DriveRefused("\n".join(map(str, problems)))


def show_changed(label: str, changes: Sequence[tuple[Entry, int | None, int]], column: str) -> None:
    """Print the objects of a drive: present value, where readable, and new value."""
    if not changes:
        say(f"{label}: nothing differs")
        return
    table = Table(title=Text(label), title_justify="left", box=None, pad_edge=False)
    for heading in ("object", "name"):
        table.add_column(heading)
    for heading in ("value on the drive", column):
        table.add_column(heading, justify="right")
    for entry, present, value in changes:
        held = "-" if present is None else entry.shown(present)
        place = entry.place
        table.add_row(place, Text(entry.name), held, entry.shown(value))
    out.print(table, highlight=False)
