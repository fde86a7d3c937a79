"""Terminal output of changes to drives' settings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.commissioning.announcement import announce
from drivers.drive_bus import DriveError, DriveRefused
from drivers.found_settings.keeping import SettingsKeeper
from hil.show.table import Column, figures, table
from hil.show.terminal import show
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
        Unsuitable drives, a line each, after the tables of the suitable drives.
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
        say(f"{label}: all settings have the required values")
        return
    name, values = Column("name", folds=True), figures("value on the drive", column)
    heads: tuple[str | Column, ...] = ("object", name, *values)
    rows = [
        (entry.place, entry.name, "-" if held is None else entry.shown(held), entry.shown(value))
        for entry, held, value in changes
    ]
    show(table(label, heads, rows), out)
