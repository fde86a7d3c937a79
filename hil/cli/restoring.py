"""Command `hil drives restore`: found settings written back after a killed session."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import PLANT, BusOptions, refuse_no_channel
from hil.runs import SIMULATED
from hil.terminal.console import say
from hil.terminal.interruption import interruptible

if TYPE_CHECKING:
    from drivers.found_settings.settings_file import FoundSettings
    from drivers.session.connection import Fieldbus


def restore(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="File of found settings, such as RUN/found-settings.yaml."
        ),
    ],
    interface: Annotated[
        str | None,
        typer.Option(help="Interface of python-can, or ethercat; that of the file by default."),
    ] = None,
    channel: Annotated[
        str | None, typer.Option(help="Channel of the interface; that of the file by default.")
    ] = None,
    bus_option: BusOptions = None,
    other_bus: Annotated[
        bool, typer.Option("--other-bus", help="Accept another bus than the file states.")
    ] = False,
) -> None:
    """Restore the drives' settings after a session that was killed; the drives must be off."""
    from drivers.found_settings.settings_file import load_found_settings
    from hil.cli import bus_access
    from hil.runs.atomic_file import locked
    from hil.tasks.bus_state import BusState

    settings = load_found_settings(file)
    if not settings.unrestored:
        say(f"{file}: already restored; nothing was written; {_conclusion(settings)}")
        return
    bus_name = _bus_of(file, settings, interface, channel, other_bus=other_bus)
    with ExitStack() as stack:
        stack.enter_context(locked(file.parent))
        if bus_name[0] != SIMULATED:
            stack.enter_context(BusState(*bus_name).locked())
        bus = stack.enter_context(
            bus_access.open_interface(*bus_name, settings.bitrate, bus_option)
        )
        ended = "stopped; repeat the command to continue"
        stack.enter_context(interruptible(lambda: ended))
        settings, failed = _put_back(bus, settings, file)
        if settings.restored:
            BusState(*_kept_bus(settings, bus_name)).forget_run(file)
    if settings.restored:
        say(f"{file}: {_conclusion(settings)}")
    if failed:
        raise typer.Exit(1)


def _put_back(bus: Fieldbus, settings: FoundSettings, file: Path) -> tuple[FoundSettings, bool]:
    """Restore drive by drive and update the file; return settings, and True if any failed."""
    from drivers.found_settings.settings_file import dump_found_settings
    from drivers.operator_tools.put_back import put_back
    from hil.cli.bus_access import show_changed
    from hil.runs.atomic_file import write_file

    failed = False
    for drive in settings.unrestored:
        if drive.doubt:
            say(f"{drive.name} (node {drive.node}): {drive.doubt}", style="yellow")
    for each in put_back(bus, settings):
        show_changed(each.label, each.written, "put back")
        settings = settings.update_drives([each.drive])
        write_file(file, dump_found_settings(settings).encode())
        for line in each.left:
            say(line, style="yellow")
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
    """Return interface and channel: from the options, else from the file, else of the plant."""
    from checked_files.yaml_file import FileError

    kept = settings.interface, settings.channel
    interface = interface or settings.interface or SIMULATED
    if channel is None and interface == settings.interface:
        channel = settings.channel
    refuse_no_channel(interface, channel)
    bus = interface, channel or PLANT
    if None not in kept and bus != kept and not other_bus:
        raise FileError(
            f"{file}: belongs to drives on {kept[0]} {kept[1]}, not on {bus[0]} {bus[1]}; omit "
            "--interface and --channel, or add --other-bus if these drives are on that bus now"
        )
    return bus


def _conclusion(settings: FoundSettings) -> str:
    refused = [f"{drive.name} {each}" for drive in settings.drives for each in drive.refused]
    if not refused:
        return "the settings of all drives are restored"
    return (
        "the settings of all drives are restored, except for refused objects: "
        f"{', '.join(refused)}; set these objects with the maker's tool"
    )
