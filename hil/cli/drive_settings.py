"""What drives held before they were written to: where it is kept, shown, and put back.

`hil run` keeps it in its run's folder. Other commands that power drives have no folder; theirs is
in the user's state directory, one file a bus, and goes once everything has been put back. There a
run leaves word of its folder as long as its drives hold values of ours, so that no later session on
that bus takes them for found ones. For the virtual plant, which is made anew by each command,
nothing is kept there.
"""

from __future__ import annotations

import os
import re
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from drivers.drive_bus import DriveError, DriveRefused
from drivers.found_settings import NAME, dump_found_settings, load_found_settings
from drivers.settings_keeper import SettingsKeeper
from drivers.yaml_file import FileError
from hil.cli import drive_commands as shared
from hil.measuring.atomic_file import operator_told, write_file
from hil.measuring.run_journal import SIMULATED
from hil.measuring.run_lock import locked
from hil.terminal import changes_view
from hil.terminal.interruption import interruptible
from hil.terminal.run_command import bus_options

if TYPE_CHECKING:
    from collections.abc import Iterator

    import can

    from drivers.drives_file import DrivesFile
    from drivers.found_settings import FoundSettings
    from drivers.sdo import Entry

PLANT = "manutec-r15"
REPLAY = "replay"
STATE = "XDG_STATE_HOME"


def kept_in(folder: Path) -> SettingsKeeper:
    """Return what keeps the drives' settings in the folder of a run."""
    return SettingsKeeper(folder / NAME, write_file)


@contextmanager
def keeper_of_run(folder: Path, interface: str, channel: str) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings in the folder of a run; a replay has no drives.

    Raises
    ------
    FileError
        The drives hold values of a session that was killed.
    """
    if interface == REPLAY:
        yield SettingsKeeper()
        return
    keeper = kept_in(folder)
    word = None if interface == SIMULATED else word_file(interface, channel)
    if word is not None:
        _refuse_left_behind(interface, channel, folder / NAME)
        _write_with_folder(word, f"{(folder / NAME).resolve()}\n".encode())
    try:
        yield keeper
    finally:
        _report_unrestored(keeper)
        if word is not None and not _left_behind(folder / NAME):
            word.unlink(missing_ok=True)


@contextmanager
def keeper_of_bus(interface: str, channel: str | None) -> Iterator[SettingsKeeper]:
    """Keep the drives' settings while a command without a folder has them powered."""
    if interface == SIMULATED:
        yield SettingsKeeper()
        return
    _refuse_left_behind(interface, channel or "", None)
    keeper = SettingsKeeper(state_file(interface, channel or ""), _write_with_folder)
    try:
        yield keeper
    finally:
        _report_unrestored(keeper)
        if keeper.path is not None and keeper.path.exists() and not keeper.unrestored:
            _remove_restored(keeper.path)


def state_file(interface: str, channel: str) -> Path:
    """Where the settings found on a bus are kept by commands without a folder of their own."""
    stated = os.environ.get(STATE, "")
    home = Path(stated) if Path(stated).is_absolute() else Path.home() / ".local" / "state"
    name = re.sub(r"[^\w.-]+", "_", f"{interface}-{channel}")
    return home / "hil" / "found-settings" / f"{name}.yaml"


def word_file(interface: str, channel: str) -> Path:
    """Where a run on a bus says in which file its drives' settings are."""
    return state_file(interface, channel).with_suffix(".run")


def _refuse_left_behind(interface: str, channel: str, ours: Path | None) -> None:
    """Refuse a bus whose drives still hold what a session wrote that was killed.

    A session that was kept in `ours` itself may go on: there the values found first stand.
    """
    word, left = word_file(interface, channel), []
    if word.exists():
        left.append(Path(word.read_text(encoding="utf-8").strip()))
    if ours is not None:
        left.append(state_file(interface, channel))
    for path in left:
        same = ours is not None and path == ours.resolve()
        if not same and _left_behind(path):
            raise FileError(
                f"{path}: drives on {interface} {channel} hold what an earlier session wrote, which"
                f" was ended before it could put back what it had found; with the drives off, put"
                f" it back: hil drives restore {path} --interface {interface} --channel {channel}"
                " (or remove the file if the drives have been set up anew)"
            )


def _left_behind(path: Path) -> bool:
    """Whether drives may hold values of the session that was kept in a file."""
    return path.exists() and bool(load_found_settings(path).unrestored)


def _report_unrestored(keeper: SettingsKeeper) -> None:
    """State on standard error where the settings are that drives do not hold again."""
    if keeper.unrestored and keeper.path is not None:
        typer.echo(
            f"not all drives hold again what they held before; it is kept in {keeper.path}: with"
            f" the drives off, put it back with hil drives restore {keeper.path}",
            err=True,
        )


def restore(
    file: Annotated[Path, typer.Argument(help=f"File of found settings, such as RUN/{NAME}.")],
    interface: shared.Interface = SIMULATED,
    channel: shared.Channel = None,
    bus_option: shared.BusOptions = None,
) -> None:
    """Put back what drives held before a session that was killed; they must be off."""
    from drivers.probing.put_back import put_back  # noqa: PLC0415 - slow to import

    settings = load_found_settings(file)
    if not settings.unrestored:
        shared.out.print(f"{file}: has been put back already; nothing was written", soft_wrap=True)
        return
    failed = False
    with ExitStack() as stack:
        stack.enter_context(locked(file.parent))
        bus = stack.enter_context(_opened(settings, interface, channel, bus_option))
        ended = "stopped; run the same command again to go on"
        stack.enter_context(interruptible(lambda: ended))
        for each in put_back(bus, settings):
            rows = [_row(entry, present, value) for entry, present, value in each.written]
            changes_view.render(each.label, rows, shared.out, "put back")
            settings = settings.with_drives([each.drive])
            write_file(file, dump_found_settings(settings).encode())
            if each.problem:
                typer.echo(each.problem, err=True)
                failed = True
    if failed:
        raise typer.Exit(1)
    shared.out.print(f"{file}: all drives hold again what they held", soft_wrap=True)


def show_changes(drives: DrivesFile, bus: can.BusABC, keeper: SettingsKeeper) -> None:
    """List what a session would write to each drive; nothing is written.

    Raises
    ------
    DriveError
        Drives that cannot serve, a line each, after the others' tables.
    """
    from drivers.announcement import announce  # noqa: PLC0415 - slow to import
    from drivers.probing.standing import StandingDrives  # noqa: PLC0415 - slow to import

    keeper.open(drives)
    problems: list[DriveError] = []
    for server, axis in zip(StandingDrives(bus, drives).servers, drives.axes, strict=True):
        try:
            found = announce(
                server, axis, drives, drives.sync_period, partial(keeper.found, server)
            )
        except DriveError as error:
            problems.append(error)
            continue
        rows = [_row(each.entry, each.present, each.value) for each in found.changes]
        changes_view.render(server.label, rows, shared.out, "to be written")
        for note in found.limits.notes:
            shared.out.print(note, style="yellow", highlight=False, soft_wrap=True)
    if problems:
        raise DriveRefused("\n".join(map(str, problems)))


def _row(entry: Entry, present: int | None, value: int) -> changes_view.Row:
    place = f"{entry.index:04X}:{entry.subindex:02X}"
    held = "-" if present is None else entry.shown(present)
    return changes_view.Row(place, entry.name, held, entry.shown(value))


@contextmanager
def _opened(
    settings: FoundSettings, interface: str, channel: str | None, pairs: list[str] | None
) -> Iterator[can.BusABC]:
    from drivers.open_bus import open_can_bus  # noqa: PLC0415 - slow to import

    if channel is None and interface != SIMULATED:
        raise typer.BadParameter(f"interface {interface} needs a channel too, such as can0")
    options = {"bitrate": settings.bitrate, **bus_options(pairs or [])}
    with open_can_bus(interface, channel or PLANT, options) as bus:
        yield bus


def _write_with_folder(path: Path, content: bytes) -> None:
    with operator_told(path.parent, "made"):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content)


def _remove_restored(path: Path) -> None:
    if load_found_settings(path).restored:
        with operator_told(path, "removed"):
            path.unlink(missing_ok=True)
