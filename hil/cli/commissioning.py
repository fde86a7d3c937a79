"""Commissioning commands for single drives: check, jog, home, reset faults, restore settings.

Each command opens a bus, calls a function of `drivers.operator_tools` and shows the result. Motion
needs the operator's consent, asked for at the terminal or given by ``--yes``; space, q and Esc stop
it, and Ctrl-C does. At the end of a command, for any reason, the axes stop and are switched off.
"""

from __future__ import annotations

import math
from collections import Counter
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text
from typer import Argument, Option

from hil.cli.arguments import (
    PLANT,
    AxisName,
    BusOptions,
    Drives,
    DrivesBus,
    RealTime,
    Yes,
    expand_records,
    refuse_no_channel,
)
from hil.runs import SIMULATED
from hil.show.table import figures, table
from hil.show.terminal import show, show_beside, show_sentence
from hil.terminal.console import give, give_each, out, say
from hil.terminal.keys import interruptible

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from rich.console import Console

    from drivers.commissioning.verdict import Verdict
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.found_settings.keeping import SettingsKeeper
    from drivers.found_settings.settings_file import FoundSettings
    from drivers.operator_tools.sync_period import WakeUps
    from drivers.session.connection import Fieldbus
    from hil.terminal.keys import TerminalOperator


def restore(
    file: Annotated[
        Path,
        Argument(metavar="FILE", help="File of found settings, such as RUN/found-settings.yaml."),
    ],
    interface: Annotated[
        str | None,
        Option(help="Interface of python-can, or ethercat; that of the file by default."),
    ] = None,
    channel: Annotated[
        str | None, Option(help="Channel of the interface; that of the file by default.")
    ] = None,
    bus_option: BusOptions = None,
    other_bus: Annotated[
        bool, Option("--other-bus", help="Accept another bus than the file states.")
    ] = False,
) -> None:
    """Restore the drives' settings after a session that was killed; the drives must be off."""
    from checked_files.yaml_file import FileError
    from drivers.found_settings.settings_file import dump_found_settings, load_found_settings
    from drivers.operator_tools.put_back import put_back
    from hil.cli import bus_access
    from hil.runs.atomic_file import locked, write_file
    from hil.tasks.bus_state import BusState

    settings = load_found_settings(file)
    if not settings.unrestored:
        say(f"{file}: already restored; nothing was written; {_conclusion(settings)}")
        return
    # from the options, else from the file, else of the plant
    kept = settings.interface, settings.channel
    interface = interface or settings.interface or SIMULATED
    if channel is None and interface == settings.interface:
        channel = settings.channel
    refuse_no_channel(interface, channel)
    bus_name = interface, channel or PLANT
    if None not in kept and bus_name != kept and not other_bus:
        raise FileError(
            f"{file}: belongs to drives on {kept[0]} {kept[1]}, not on {bus_name[0]} {bus_name[1]};"
            " omit --interface and --channel, or add --other-bus if these drives are on that bus"
            " now"
        )
    with ExitStack() as stack:
        stack.enter_context(locked(file.parent))
        if bus_name[0] != SIMULATED:
            stack.enter_context(BusState(*bus_name).locked())
        bus = stack.enter_context(
            bus_access.open_interface(*bus_name, settings.bitrate, bus_option)
        )
        ended = "stopped; repeat the command to continue"
        stack.enter_context(interruptible(lambda: ended))
        failed = False
        for drive in settings.unrestored:
            if drive.doubt:
                say(f"{drive.name} (node {drive.node}): {drive.doubt}", style="yellow")
        for each in put_back(bus, settings):
            bus_access.show_changed(each.label, each.written, "put back")
            settings = settings.update_drives([each.drive])
            write_file(file, dump_found_settings(settings).encode())
            for line in each.left:
                say(line, style="yellow")
            if each.problem:
                typer.echo(each.problem, err=True)
                failed = True
        if settings.restored:
            stated = zip(kept, bus_name, strict=True)
            BusState(*(known or otherwise for known, otherwise in stated)).forget_run(file)
    if settings.restored:
        say(f"{file}: {_conclusion(settings)}")
    if failed:
        raise typer.Exit(1)


def _conclusion(settings: FoundSettings) -> str:
    refused = [f"{drive.name} {each}" for drive in settings.drives for each in drive.refused]
    if not refused:
        return "the settings of all drives are restored"
    return (
        "the settings of all drives are restored, except for refused objects: "
        f"{', '.join(refused)}; set these objects with the maker's tool"
    )


@expand_records
def check(
    drives_file: Drives,
    where: DrivesBus,
    axis: Annotated[
        list[str] | None,
        Option(metavar="AXIS", help="Axis to check; all by default; may be repeated."),
    ] = None,
    angle: Annotated[
        float, Option(min=0.5, max=20, help="Amplitude of the small moves \\[deg].")
    ] = 3.0,
    speed: Annotated[
        float, Option(min=0.1, max=20, help="Speed of the small moves \\[deg/s].")
    ] = 5,
    model: Annotated[
        Path | None,
        Option(
            help="Identified run; its gravity torques are used to check the direction of each "
            "joint."
        ),
    ] = None,
    realtime: RealTime = False,
    jitter_time: Annotated[
        float,
        Option(min=0, max=600, help="Measuring time for this computer's wake-up jitter \\[s]."),
    ] = 10.0,
    yes: Yes = False,
) -> None:
    """Check every drive against the drives file; in the end by a small move of each axis."""
    from drivers.operator_tools.check import check as check_drives
    from drivers.operator_tools.check_powered import SmallMoves
    from hil.cli import bus_access

    drives = bus_access.select_axes(drives_file, axis)
    gravity = None
    if model is not None:
        from hil.results.model import Model

        identified = Model.load(model)
        if identified.robot.n_joints != len(drives.axes):
            raise typer.BadParameter(
                f"--model: {model} has {identified.robot.n_joints} joints and {len(drives.axes)}"
                " axes are checked; check all axes of the robot together, without --axis"
            )
        gravity = identified.gravity
    moves = SmallMoves(angle=math.radians(angle), angular_velocity=math.radians(speed))
    with (
        _open_session(drives_file, drives, where, agreed=yes) as (bus, operator, keeper),
        bus_access.real_time_if(realtime, lock_step=bus.lock_step) as granted,
    ):
        for line in granted:
            say(line)
        computer, late = _wake_ups(bus, drives.sync_period, jitter_time, realtime=realtime)
        checked = check_drives(bus, drives, moves, operator, keeper, gravity, late)
        with closing(checked) as verdicts:
            serves = show_verdicts(chain(computer, verdicts), out)
    if not serves:
        raise typer.Exit(1)


@expand_records
def jog(
    drives_file: Drives,
    axis: AxisName,
    by: Annotated[float, Option(help="Signed distance to move \\[deg; mm if prismatic].")],
    speed: Annotated[
        float, Option(min=0.01, help="Speed of the axis \\[deg/s; mm/s if prismatic].")
    ] = 5,
    *,
    where: DrivesBus,
    yes: Yes = False,
) -> None:
    """Move one axis by a small distance, slowly; no other axis is powered."""
    from drivers.operator_tools import home as jogging
    from drivers.operator_tools.small_move import format_coordinate
    from hil.cli import bus_access

    drives = bus_access.select_axes(drives_file)
    drive = bus_access.find_axis(drives, axis)
    with _open_session(drives_file, drives, where, agreed=yes) as (bus, operator, keeper):
        way, velocity = _si(drive, by), _si(drive, speed)
        stroke = jogging.jog(bus, drives, drive, way, velocity, operator, keeper=keeper)
    torque = drive.effort_unit
    give(
        axis=drive.name, q=[float(stroke.q[0]), float(stroke.q[-1])],
        following_error=float(stroke.following_error),
        position_unit="m" if drive.joint == "prismatic" else "rad",
        peak_torque=float(stroke.peak_torque), torque_unit=torque,
    )  # fmt: skip
    start, end, error = (
        format_coordinate(drive, value)
        for value in (stroke.q[0], stroke.q[-1], stroke.following_error)
    )
    say(
        f"{drive.name}: from {start} to {end}, torque at most {stroke.peak_torque:.3g} {torque},"
        f" following error at most {error}; off"
    )


@expand_records
def home(
    drives_file: Drives,
    axis: AxisName,
    method: Annotated[
        int | None,
        Option(min=-128, max=37, help="Homing method (6098) in place of the drives file's."),
    ] = None,
    patience: Annotated[float, Option(min=1, help="Maximum duration of homing \\[s].")] = 60,
    *,
    where: DrivesBus,
    yes: Yes = False,
) -> None:
    """Home an axis in the drive's homing mode; no other axis is powered."""
    from checked_files.yaml_file import FileError
    from drivers.operator_tools import home as homing
    from drivers.operator_tools.small_move import format_coordinate
    from hil.cli import bus_access

    drives = bus_access.select_axes(drives_file)
    drive = bus_access.find_axis(drives, axis)
    if drive.homing is None:
        path = bus_access.drives_path(drives_file)
        raise FileError(f"{path}: {drive.name}: homing is missing; state method, position, speeds")
    how = drive.homing if method is None else drive.homing.model_copy(update={"method": method})
    with _open_session(drives_file, drives, where, agreed=yes) as (bus, operator, keeper):
        q = homing.home(bus, drives, drive, how, operator, patience=patience, keeper=keeper)
    give(axis=drive.name, method=how.method, q=float(q))
    say(f"{drive.name}: homed by method {how.method}, position {format_coordinate(drive, q)}; off")


@expand_records
def reset_faults(
    drives_file: Drives,
    axis: Annotated[
        list[str] | None,
        Option(metavar="AXIS", help="Axis to reset; all by default; may be repeated."),
    ] = None,
    *,
    where: DrivesBus,
    yes: Yes = False,
) -> None:
    """Show the faults of drives with causes and reset them; nothing is powered on."""
    from drivers.operator_tools.reset_faults import reset_faults as reset
    from hil.cli import bus_access

    drives = bus_access.select_axes(drives_file, axis)
    with _open_session(drives_file, drives, where, agreed=yes) as (bus, operator, _):
        serves = show_verdicts(reset(bus, drives, operator), out)
    if not serves:
        raise typer.Exit(1)


@contextmanager
def _open_session(
    drives_file: str, drives: DrivesFile, where: DrivesBus, *, agreed: bool
) -> Iterator[tuple[Fieldbus, TerminalOperator, SettingsKeeper]]:
    """Open bus and terminal, and keep the drives' found settings."""
    from hil.cli import bus_access
    from hil.tasks.bus_state import keeper_of_bus
    from hil.terminal.keys import Keys, TerminalOperator

    with (
        bus_access.open_bus(drives_file, drives, where) as bus,
        interruptible(lambda: "stopped; the axes are off"),
        Keys() as keys,
        keeper_of_bus(where.interface, where.channel) as keeper,
    ):
        yield bus, TerminalOperator(out, keys, agreed=agreed), keeper


def _wake_ups(
    bus: Fieldbus, period: float, duration: float, *, realtime: bool
) -> tuple[list[Verdict], float]:
    """Measure this computer's wake-up jitter, before any motion; skipped in lock-step.

    Returns verdicts, and the lateness of SYNC caused by the jitter [s].
    """
    from drivers.operator_tools import sync_period

    if duration and not bus.lock_step:
        # plain text: an animated line would disturb the measured wake-ups
        say(f"measuring this computer's wake-up jitter for {duration:g} s")
    found = sync_period.wake_ups_on(bus, period, duration) if duration else None
    if found is None:
        return [], 0.0
    show_wake_ups(found, sync_period.IN_TIME, out)
    judged = sync_period.judge_wake_ups(found, real_time=realtime, by_kernel=bus.keeps_time)
    return [judged], 0.0 if bus.keeps_time else found.quantile(sync_period.IN_TIME)


def _si(drive: AxisDrive, value: float) -> float:
    """Convert degrees to rad, or mm to m."""
    return value / 1000 if drive.joint == "prismatic" else math.radians(value)


STYLES = {"ok": "green", "warning": "yellow", "refused": "bold red"}
EDGES = (0.0, 50e-6, 100e-6, 200e-6, 500e-6, 1e-3, 2e-3, 5e-3, 10e-3, 20e-3)
"""Lower ends of the lateness classes [s]; the last is open."""


def show_verdicts(verdicts: Iterable[Verdict], console: Console) -> bool:
    """Print verdicts by axis and the count per grade; return False if any verdict is a refusal."""
    counts: Counter[str] = Counter()
    place = ""
    for verdict in verdicts:
        if verdict.place != place:
            place = verdict.place
            console.print(f"\n{place}", style="bold", highlight=False, markup=False)
        counts[verdict.grade.value] += 1
        give_each("verdicts", asdict(verdict) | {"grade": verdict.grade.value})
        grade = verdict.grade.value
        head = Text.assemble((f"{grade:<9}", STYLES[grade]), verdict.check)
        bound = f"  ({verdict.bound})" if verdict.bound else ""
        show_beside(head, f"{verdict.found}{bound}", 42, console)
        if verdict.remedy:
            show_beside(Text(f"{'':9}->"), verdict.remedy, 12, console)
    total = ", ".join(f"{counts[grade]} {grade}" for grade in STYLES)
    console.print(f"\n{total}", highlight=False)
    return not counts["refused"]


def show_wake_ups(found: WakeUps, in_time: float, console: Console) -> None:
    """Print quantiles of the lateness, the last for the share `in_time`, and a histogram."""
    import numpy as np

    shares = {share: _ms(found.quantile(share)) for share in (0.5, 0.99, in_time)}
    quantiles = ", ".join(f"{100 * share:.4g} % within {late}" for share, late in shares.items())
    show_sentence(
        f"delay of {len(found.late)} wake-ups at {1 / found.period:.4g} Hz: {quantiles},"
        f" longest {_ms(found.longest)}",
        console,
    )
    classes = np.histogram(found.late, [*EDGES, math.inf])[0].tolist()
    last, most = max(k for k, number in enumerate(classes) if number), max(classes)
    rows = []
    for low, high, number in zip(EDGES, (*EDGES[1:], None), classes[: last + 1], strict=False):
        name = f"under {_ms(high)}" if high else f"{_ms(low)} or more"
        bar = "#" * max(round(40 * number / most), 1 if number else 0)
        rows.append((name, str(number), bar))
    show(table("", ("late by", *figures("wake-ups"), ""), rows), console)


def _ms(value: float) -> str:
    return f"{1000 * value:.3g} ms"
