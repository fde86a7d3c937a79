"""What drives held before they were written to: where it is kept, and what a session would write.

`hil run` keeps it in its run's folder. Other commands that power drives have no folder; theirs is
in the user's state directory (`bus_state`), one file a bus, and goes once everything has been put
back. Whoever commands the drives of a bus holds its lock. For the virtual plant, which is made anew
by each command, nothing is kept there and nothing is locked.
"""

from __future__ import annotations

from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer
from rich.table import Table
from rich.text import Text

from drivers.commissioning.announcement import announce
from drivers.drive_bus import DriveError, DriveRefused
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import NAME, load_found_settings
from hil.cli.bus_state import BusState, left_behind
from hil.runs import SIMULATED
from hil.runs.atomic_file import file_errors, write_file
from hil.terminal.console import out, say

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import Entry
    from drivers.session.connection import Fieldbus

REPLAY = "replay"


def kept_in(folder: Path, interface: str, channel: str) -> SettingsKeeper:
    """Return what keeps the drives' settings in the folder of a run."""
    return SettingsKeeper(folder / NAME, write_file, (interface, channel))


@contextmanager
def keeper_of_run(folder: Path, interface: str, channel: str) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings in the folder of a run; a replay has no drives.

    Raises
    ------
    FileError
        The drives hold values of a session that was killed, or another process commands them.
    """
    if interface == REPLAY:
        yield SettingsKeeper()
        return
    kept = folder / NAME
    if interface == SIMULATED:
        with _reported(kept_in(folder, interface, channel)) as keeper:
            yield keeper
        return

    state = BusState(interface, channel)

    def write(path: Path, content: bytes) -> None:
        write_file(path, content)
        state.name_run(kept)  # from here on the drives are written to

    with state.locked():
        state.refuse_left_behind(kept)
        with _reported(SettingsKeeper(kept, write, (interface, channel))) as keeper:
            try:
                yield keeper
            finally:
                if not keeper.unrestored and not left_behind(kept):
                    state.forget_run(kept)


@contextmanager
def keeper_of_bus(interface: str, channel: str | None) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings while a command without a folder has them powered.

    Raises
    ------
    FileError
        The drives hold values of a session that was killed, or another process commands them.
    """
    if interface == SIMULATED:
        yield SettingsKeeper()
        return
    state = BusState(interface, channel := channel or "")
    path = state.settings
    with state.locked():
        state.refuse_left_behind(None)
        with _reported(SettingsKeeper(path, state.write, (interface, channel))) as keeper:
            try:
                yield keeper
            finally:
                if path.exists() and not keeper.unrestored and load_found_settings(path).restored:
                    with file_errors(path, "removed"):
                        path.unlink(missing_ok=True)


@contextmanager
def _reported(keeper: SettingsKeeper) -> Iterator[SettingsKeeper]:
    """State on standard error where the settings are that drives do not hold again."""
    try:
        yield keeper
    finally:
        if keeper.unrestored and keeper.path is not None:
            typer.echo(
                f"not all drives hold again what they held before; it is kept in {keeper.path}:"
                f" with the drives off, put it back with hil drives restore {keeper.path}",
                err=True,
            )


def show_changes(drives: DrivesFile, bus: Fieldbus, keeper: SettingsKeeper) -> None:
    """List what a session would write to each drive; nothing is written.

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
    """Print one drive's objects: what it holds, where it can be read, and what is written."""
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
        place = f"{entry.index:04X}:{entry.subindex:02X}"
        table.add_row(place, Text(entry.name), held, entry.shown(value))
    out.print(table, highlight=False)
