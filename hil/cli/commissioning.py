"""Commands about the drives themselves, before a robot is measured: check, jog, home, monitor.

Each opens a bus, hands it to a function of `drivers.probing` and shows what comes back. Motion
needs the operator's consent, asked for at the terminal or given by ``--yes``; space, q and Esc stop
it, and Ctrl-C does. Whatever ends a command, the axes stop and are switched off.
"""

from __future__ import annotations

import math
import signal
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from drivers.drives_file import AxisDrive, DrivesFile, load_drives
from hil.measuring.run_journal import SIMULATED
from hil.model.robot import ROBOTS
from hil.terminal import check_view
from hil.terminal.keys import Keys
from hil.terminal.operator import TerminalOperator
from hil.terminal.run_command import bus_options

if TYPE_CHECKING:
    from collections.abc import Iterator

    import can

    from drivers.probing.verdict import Verdict

commands = typer.Typer()
out = Console()

SUFFIX = ".drives.yaml"

Drives = Annotated[
    str, typer.Argument(help="Drives file, or name of a robot whose drives file comes along.")
]
AxisName = Annotated[str, typer.Argument(help="Name of an axis, or its number from 1.")]
Interface = Annotated[str, typer.Option(help="python-can's interface.")]
Channel = Annotated[
    str | None, typer.Option(help="Its channel; on sim_plant by default the robot's name.")
]
BusOptions = Annotated[
    list[str] | None,
    typer.Option("--bus-option", help="key=value for python-can, may be repeated."),
]
Yes = Annotated[bool, typer.Option("--yes", help="Agree to motion beforehand; ask nothing.")]


@commands.command()
def check(
    drives_file: Drives,
    interface: Interface = SIMULATED,
    channel: Channel = None,
    bus_option: BusOptions = None,
    axis: Annotated[
        list[str] | None, typer.Option(help="Check this one alone, may be repeated.")
    ] = None,
    angle: Annotated[float, typer.Option(min=0.5, max=20, help="Of the small moves [deg].")] = 3.0,
    speed: Annotated[float, typer.Option(min=0.1, max=20, help="Of the small moves [deg/s].")] = 5,
    yes: Yes = False,
) -> None:
    """Check every drive against the drives file, at last by a small move of each axis."""
    from drivers.probing.live_check import check as check_drives  # noqa: PLC0415 - slow to import
    from drivers.probing.powered_check import SmallMoves  # noqa: PLC0415 - slow to import

    drives = _selected(drives_file, axis)
    moves = SmallMoves(angle=math.radians(angle), angular_velocity=math.radians(speed))
    with (
        _bus(drives_file, drives, interface, channel, bus_option) as bus,
        _operator(agreed=yes) as operator,
        closing(check_drives(bus, drives, moves, operator)) as verdicts,
    ):
        serves = check_view.show(map(_line, verdicts), out)
    if not serves:
        raise typer.Exit(1)


def _line(verdict: Verdict) -> check_view.Line:
    return check_view.Line(
        verdict.grade.value,
        verdict.place,
        verdict.check,
        verdict.found,
        verdict.bound,
        verdict.remedy,
    )


def _selected(name: str, axes: list[str] | None) -> DrivesFile:
    """Return a drives file, or as much of it as concerns some axes."""
    drives = load_drives(_path(name))
    if not axes:
        return drives
    return drives.model_copy(update={"axes": tuple(_axis(drives, axis) for axis in axes)})


def _axis(drives: DrivesFile, name: str) -> AxisDrive:
    names = [axis.name for axis in drives.axes]
    if name in names:
        return drives.axes[names.index(name)]
    if name.isdecimal() and 1 <= int(name) <= len(names):
        return drives.axes[int(name) - 1]
    raise typer.BadParameter(f"{name!r} must be one of {', '.join(names)}, or 1 to {len(names)}")


def _path(name: str) -> Path:
    packaged = ROBOTS / f"{name}{SUFFIX}"
    return packaged if packaged.is_file() else Path(name)


@contextmanager
def _bus(
    name: str, drives: DrivesFile, interface: str, channel: str | None, pairs: list[str] | None
) -> Iterator[can.BusABC]:
    """Open a bus, and shut it down whatever happens."""
    from drivers.open_bus import open_can_bus  # noqa: PLC0415 - slow to import

    if channel is None:
        if interface != SIMULATED:
            raise typer.BadParameter(f"interface {interface} needs a channel too, such as can0")
        channel = _path(name).name.removesuffix(SUFFIX)
    options = {"bitrate": drives.bitrate, **bus_options(pairs or [])}
    with open_can_bus(interface, channel, options) as bus:
        yield bus


@contextmanager
def _operator(*, agreed: bool) -> Iterator[TerminalOperator]:
    """Ask and listen at the terminal; Ctrl-C and SIGTERM end the command in order."""
    previous = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with Keys() as keys:
            yield TerminalOperator(out, keys, agreed=agreed)
    except KeyboardInterrupt:
        typer.echo("stopped; the axes are off", err=True)
        raise typer.Exit(130) from None
    finally:
        signal.signal(signal.SIGTERM, previous)
