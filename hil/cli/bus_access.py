"""Shared parts of the drive commands: drives file, open bus, operator, changes of settings."""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from checked_files.near import did_you_mean
from checked_files.yaml_file import FileError
from drivers.commissioning.announcement import announce
from drivers.drive_bus import DriveError, DriveRefused
from drivers.drives_file import load_drives
from drivers.found_settings.keeping import SettingsKeeper
from drivers.opening import open_fieldbus
from hil.cli.arguments import parse_pairs, refuse_no_channel
from hil.cli.doctor import real_time, short_slices
from hil.model.robot import ROBOTS
from hil.show.table import Column, figures, table
from hil.show.terminal import show
from hil.terminal.console import out, say

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.session.connection import Fieldbus
    from hil.cli.arguments import DrivesBus


SUFFIX = ".drives.yaml"


def select_axes(name: str, axes: list[str] | None = None) -> DrivesFile:
    """Load a drives file, optionally reduced to some axes."""
    drives = load_drives(drives_path(name))
    if not axes:
        return drives
    return drives.model_copy(update={"axes": tuple(find_axis(drives, axis) for axis in axes)})


def find_axis(drives: DrivesFile, name: str) -> AxisDrive:
    """Find an axis by name or by number from 1."""
    names = [axis.name for axis in drives.axes]
    if name in names:
        return drives.axes[names.index(name)]
    if name.isdecimal() and 1 <= int(name) <= len(names):
        return drives.axes[int(name) - 1]
    near = did_you_mean(name, names)
    raise typer.BadParameter(
        f"{name!r} must be one of {', '.join(names)}, or 1 to {len(names)}{near}"
    )


def drives_path(name: str) -> Path:
    """Return the path of a drives file, given by path or by the name of a built-in robot.

    Raises
    ------
    FileError
        Neither a built-in robot nor a drives file.
    """
    packaged, path = ROBOTS / f"{name}{SUFFIX}", Path(name)
    if packaged.is_file():
        return packaged
    if not path.suffix and not path.exists():
        along = ", ".join(_robots())
        raise FileError(
            f"{name}: is neither a built-in robot ({along}) nor a drives file; name one of these "
            "robots, or the path of a drives file"
        )
    return path


def _robots() -> list[str]:
    """Return names of the built-in robots with a drives file and a plant."""
    return sorted(path.name.removesuffix(SUFFIX) for path in ROBOTS.glob(f"*{SUFFIX}"))


def open_bus(name: str, drives: DrivesFile, where: DrivesBus) -> Fieldbus:
    """Open the bus of a drives file; the default is the built-in plant with these drives."""
    refuse_no_channel(where.interface, where.channel)
    if where.channel is not None:
        return open_interface(where.interface, where.channel, drives.bitrate, where.bus_option)

    def products(of: DrivesFile) -> set[tuple[int, int, int]]:
        return {(each.node, each.identity.vendor, each.identity.product) for each in of.axes}

    # other contents of a drives file may be wrong; a plant serves to find such errors
    robots = _robots()
    for robot in robots:
        if products(drives) <= products(load_drives(ROBOTS / f"{robot}{SUFFIX}")):
            return open_interface(where.interface, robot, drives.bitrate, where.bus_option)
    raise FileError(
        f"{drives_path(name)}: no built-in plant has these drives; name a plant with --channel "
        f"({', '.join(robots)}), or a bus with --interface and --channel"
    )


def open_interface(
    interface: str, channel: str, bitrate: int | None, pairs: list[str] | None
) -> Fieldbus:
    """Open a bus with the options of the command line, to be used as a context manager."""
    return open_fieldbus(interface, channel, {"bitrate": bitrate, **parse_pairs(pairs)})


@contextmanager
def real_time_if(wanted: bool, *, lock_step: bool) -> Iterator[tuple[str, ...]]:
    """Run in real time if wanted and SYNC has deadlines; yield the granted measures.

    Otherwise the thread at least gets short time slices, for quick wake-ups.
    """
    if lock_step:
        left_out = "real time: ignored, since SYNC in lock-step has no deadlines"
        yield (left_out,) if wanted else ()
        return
    with short_slices(), real_time() if wanted else nullcontext(()) as measures:
        yield measures


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
