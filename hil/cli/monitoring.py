"""The command that watches the bus beside whoever commands the drives."""

from __future__ import annotations

import math
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli import monitor_view
from hil.cli.arguments import BusOptions, Drives, DrivesChannel, Interface
from hil.runs import SIMULATED
from hil.terminal.console import out
from hil.terminal.interruption import interruptible
from hil.terminal.keys import Keys

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.operator_tools.monitor import AxisPicture, BusPicture

commands = typer.Typer()


@commands.command()
def monitor(
    drives_file: Drives,
    interface: Interface = SIMULATED,
    channel: DrivesChannel = None,
    bus_option: BusOptions = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--for", min=0.1, help="Duration after which the command ends by itself \\[s]."
        ),
    ] = None,
    inputs: Annotated[
        bool,
        typer.Option(
            help="Read the inputs (60FD) too, which show safe torque off, where no other master is"
            " on the bus."
        ),
    ] = False,
) -> None:
    """Show states, positions, torques and emergencies live; sends nothing unless asked to."""
    from drivers.drives_file import load_drives
    from drivers.operator_tools.monitor import BusPicture, questions
    from hil.cli import bus_access

    drives = load_drives(bus_access.drives_path(drives_file))
    picture, asked = BusPicture(drives), questions(drives) if inputs else ()
    with (
        bus_access.opened_bus(drives_file, drives, interface, channel, bus_option) as bus,
        interruptible(lambda: "stopped watching"),
        Keys() as keys,
    ):
        monitor_view.follow(
            lambda time: _listen(bus, picture, time, asked),
            lambda: _snapshot(picture, drives),
            keys,
            out,
            duration,
        )


def _listen(
    bus: can.BusABC, picture: BusPicture, duration: float, asked: Sequence[can.Message]
) -> None:
    for question in asked:
        bus.send(question)
    ends = monotonic() + duration
    while (left := ends - monotonic()) > 0:
        frame = bus.recv(left)
        if frame is not None:
            picture.take(frame, monotonic())


def _snapshot(picture: BusPicture, drives: DrivesFile) -> monitor_view.Snapshot:
    rows = [_row(axis, drive) for axis, drive in zip(picture.axes, drives.axes, strict=True)]
    return monitor_view.Snapshot(rows, picture.sync_rate(monotonic()))


def _row(axis: AxisPicture, drive: AxisDrive) -> monitor_view.AxisLine:
    silent = monotonic() - axis.heard
    unit = drive.effort_unit
    return monitor_view.AxisLine(
        axis.name,
        str(axis.node),
        axis.nmt,
        ", ".join(filter(None, (axis.state and axis.state.value, axis.interlock))),
        "" if math.isnan(axis.q) else _position(drive, axis.q),
        "" if math.isnan(axis.tau) else f"{axis.tau:.3g} {unit}",
        "never" if math.isinf(silent) else f"{silent:.1f} s",
        _alarm(axis),
    )


def _position(drive: AxisDrive, q: float) -> str:
    return f"{1000 * q:.2f} mm" if drive.joint == "prismatic" else f"{math.degrees(q):.2f}°"


def _alarm(axis: AxisPicture) -> str:
    parts = [str(axis.emergency)] if axis.emergency else []
    if axis.emergencies:
        parts.append(f"{axis.emergencies} in all")
    if axis.foreign:
        parts.append(f"{axis.foreign} TPDOs of another length")
    return "; ".join(parts)
