"""What drives held before they were written to: where it is kept, shown, and put back.

`hil run` keeps it in its run's folder. Other commands that power drives have no folder; theirs is
in the user's state directory (`bus_state`), one file a bus, and goes once everything has been put
back. Whoever commands the drives of a bus holds its lock. For the virtual plant, which is made anew
by each command, nothing is kept there and nothing is locked.
"""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from checked_files.yaml_file import FileError
from drivers.drive_bus import DriveError, DriveRefused
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.settings_file import NAME, dump_found_settings, load_found_settings
from hil.cli import bus_access as shared
from hil.cli import bus_state, changes_view
from hil.cli.arguments import PLANT, BusOptions, refuse_no_channel
from hil.runs.atomic_file import operator_told, write_file
from hil.runs.journal import SIMULATED
from hil.runs.lock import locked
from hil.terminal.console import out
from hil.terminal.interruption import interruptible

if TYPE_CHECKING:
    from collections.abc import Iterator

    import can

    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import Entry
    from drivers.found_settings.settings_file import FoundSettings

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

    def write(path: Path, content: bytes) -> None:
        write_file(path, content)
        bus_state.name_run(interface, channel, kept)  # from here on the drives are written to

    with bus_state.bus_locked(interface, channel):
        bus_state.refuse_left_behind(interface, channel, kept)
        keeper = SettingsKeeper(kept, write, (interface, channel))
        try:
            with _reported(keeper):
                yield keeper
        finally:
            if not keeper.unrestored and not bus_state.left_behind(kept):
                bus_state.forget_run(interface, channel, kept)


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
    channel = channel or ""
    with bus_state.bus_locked(interface, channel):
        bus_state.refuse_left_behind(interface, channel, None)
        path = bus_state.state_file(interface, channel)
        keeper = SettingsKeeper(path, bus_state.write_with_folder, (interface, channel))
        try:
            with _reported(keeper):
                yield keeper
        finally:
            if path.exists() and not keeper.unrestored:
                _remove_restored(path)


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


def restore(
    file: Annotated[Path, typer.Argument(help=f"File of found settings, such as RUN/{NAME}.")],
    interface: Annotated[
        str | None, typer.Option(help="python-can's interface; by default that of the file.")
    ] = None,
    channel: Annotated[
        str | None, typer.Option(help="Its channel; by default that of the file.")
    ] = None,
    bus_option: BusOptions = None,
    other_bus: Annotated[
        bool, typer.Option("--other-bus", help="Take another bus than that of the file.")
    ] = False,
) -> None:
    """Put back what drives held before a session that was killed; they must be off."""
    settings = load_found_settings(file)
    if not settings.unrestored:
        _say(f"{file}: has been put back already; nothing was written; {_conclusion(settings)}")
        return
    bus_name = _bus_of(file, settings, interface, channel, other_bus=other_bus)
    with ExitStack() as stack:
        stack.enter_context(locked(file.parent))
        if bus_name[0] != SIMULATED:
            stack.enter_context(bus_state.bus_locked(*bus_name))
        bus = stack.enter_context(shared.opened(*bus_name, settings.bitrate, bus_option))
        ended = "stopped; run the same command again to go on"
        stack.enter_context(interruptible(lambda: ended))
        settings, failed = _put_back(bus, settings, file)
        if settings.restored:
            bus_state.forget_run(*_kept_bus(settings, bus_name), file)
    if settings.restored:
        _say(f"{file}: {_conclusion(settings)}")
    if failed:
        raise typer.Exit(1)


def _put_back(bus: can.BusABC, settings: FoundSettings, file: Path) -> tuple[FoundSettings, bool]:
    """Put back drive by drive, noting it in the file; return what it holds, whether any failed."""
    from drivers.operator_tools.put_back import put_back  # noqa: PLC0415 - slow to import

    failed = False
    for drive in settings.unrestored:
        if drive.doubt:
            _say(drive.doubt, style="yellow")
    for each in put_back(bus, settings):
        rows = [_row(entry, present, value) for entry, present, value in each.written]
        changes_view.render(each.label, rows, out, "put back")
        settings = settings.with_drives([each.drive])
        write_file(file, dump_found_settings(settings).encode())
        for line in each.left:
            _say(line, style="yellow")
        if each.problem:
            typer.echo(each.problem, err=True)
            failed = True
    return settings, failed


def _kept_bus(settings: FoundSettings, otherwise: tuple[str, str]) -> tuple[str, str]:
    interface, channel = otherwise
    return settings.interface or interface, settings.channel or channel


def _bus_of(
    file: Path,
    settings: FoundSettings,
    interface: str | None,
    channel: str | None,
    *,
    other_bus: bool,
) -> tuple[str, str]:
    """Return interface and channel: what is stated, else those of the file, else the plant."""
    kept = settings.interface, settings.channel
    interface = interface or settings.interface or SIMULATED
    if channel is None and interface == settings.interface:
        channel = settings.channel
    refuse_no_channel(interface, channel)
    bus = interface, channel or PLANT
    if None not in kept and bus != kept and not other_bus:
        raise FileError(
            f"{file}: is about drives on {kept[0]} {kept[1]}, not on {bus[0]} {bus[1]}; leave"
            " --interface and --channel out, or add --other-bus if these drives are there by now"
        )
    return bus


def _conclusion(settings: FoundSettings) -> str:
    refused = [f"{drive.name} {each}" for drive in settings.drives for each in drive.refused]
    if not refused:
        return "all drives hold again what they held"
    return (
        "all drives hold again what they held, but what they do not take back:"
        f" {', '.join(refused)}; set it with the maker's commissioning tool"
    )


def _say(text: str, style: str | None = None) -> None:
    out.print(text, style=style, highlight=False, markup=False, soft_wrap=True)


def show_changes(drives: DrivesFile, bus: can.BusABC, keeper: SettingsKeeper) -> None:
    """List what a session would write to each drive; nothing is written.

    Raises
    ------
    DriveError
        Drives that cannot serve, a line each, after the others' tables.
    """
    from drivers.commissioning.announcement import announce  # noqa: PLC0415 - slow to import
    from drivers.operator_tools.unpowered import UnpoweredDrives  # noqa: PLC0415 - slow to import

    keeper.open(drives)
    problems: list[DriveError] = []
    for server, axis in zip(UnpoweredDrives(bus, drives).servers, drives.axes, strict=True):
        try:
            found = announce(
                server, axis, drives, drives.sync_period, partial(keeper.found, server)
            )
        except DriveError as error:
            problems.append(error)
            continue
        rows = [_row(each.entry, each.present, each.value) for each in found.changes]
        changes_view.render(server.label, rows, out, "to be written")
        for note in found.limits.notes:
            out.print(note, style="yellow", highlight=False, soft_wrap=True)
    if problems:
        raise DriveRefused("\n".join(map(str, problems)))


def _row(entry: Entry, present: int | None, value: int) -> changes_view.Row:
    place = f"{entry.index:04X}:{entry.subindex:02X}"
    held = "-" if present is None else entry.shown(present)
    return changes_view.Row(place, entry.name, held, entry.shown(value))


def _remove_restored(path: Path) -> None:
    if load_found_settings(path).restored:
        with operator_told(path, "removed"):
            path.unlink(missing_ok=True)
