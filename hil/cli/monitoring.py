"""Command `hil drives monitor`: passive display of the drives on a bus.

The table refreshes until a key ends the command. Without a terminal it is printed once, at the end.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Group
from rich.live import Live
from rich.text import Text

from hil.cli.arguments import Drives, DrivesBus, expand_records
from hil.show.table import Column, Marked, figures, table
from hil.show.terminal import Drawn, show
from hil.terminal.console import out
from hil.terminal.interruption import interruptible
from hil.terminal.keys import Keys

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from drivers.cia402.picture import AxisPicture, Picture
    from drivers.drives_file import AxisDrive, DrivesFile
    from hil.show.table import Table


@expand_records
def monitor(
    drives_file: Drives,
    where: DrivesBus,
    duration: Annotated[
        float | None,
        typer.Option(
            "--for",
            min=0.1,
            help="Duration of monitoring; unlimited by default \\[s].",
        ),
    ] = None,
    inputs: Annotated[
        bool,
        typer.Option(
            "--inputs",
            help="Also read the digital inputs (60FD), which show safe torque off; only without"
            " another master on the bus.",
        ),
    ] = False,
) -> None:
    """Show states, positions, torques and emergencies live; only listens."""
    from hil.cli import bus_access

    drives = bus_access.select_axes(drives_file)
    with (
        bus_access.open_bus(drives_file, drives, where) as bus,
        interruptible(lambda: "monitoring ended"),
        Keys() as keys,
    ):
        picture = bus.picture(drives, inputs=inputs)
        follow(
            picture.listen,
            lambda: _table(picture, drives),
            keys,
            out,
            duration,
        )


def follow(
    listen: Callable[[float], None],
    draw: Callable[[], Table],
    keys: Keys,
    console: Console,
    duration: float | None,
    every: float = 0.1,
) -> None:
    """Listen and show the state until q is pressed or the time is over.

    Parameters
    ----------
    listen : callable
        Function that receives frames for a duration [s].
    draw : callable
        Function that returns the table of the present state.
    keys : Keys
        Keys, already entered; p pauses and resumes the table, q ends the command.
    console : Console
        Console for the table.
    duration : float or None
        Maximum duration [s].
    every : float
        Time between two tables [s].
    """
    ends = math.inf if duration is None else time.monotonic() + duration
    paused = False
    if not console.is_terminal:
        while time.monotonic() < ends:
            listen(every)
        show(draw(), console)
        return
    with Live(console=console, auto_refresh=False, transient=False) as live:
        seen: Table | None = None
        while time.monotonic() < ends:
            listen(every)
            pressed = keys.pressed().lower()
            if "q" in pressed:
                return
            paused ^= pressed.count("p") % 2 == 1
            if seen is None or not paused:
                seen = draw()
            hint = "paused: p continues, q quits" if paused else "p pauses, q quits"
            live.update(Group(Drawn(seen), Text(hint)), refresh=True)


def _table(picture: Picture, drives: DrivesFile) -> Table:
    """Return the current state, a row per axis."""
    rate = picture.sync_rate(time.monotonic())
    rows = []
    for axis, drive in zip(picture.axes, drives.axes, strict=True):
        silent = time.monotonic() - axis.heard
        rows.append(
            (
                axis.name,
                str(axis.node),
                axis.nmt,
                ", ".join(filter(None, (axis.state and axis.state.value, axis.interlock))),
                "" if math.isnan(axis.q) else _position(drive, axis.q),
                "" if math.isnan(axis.tau) else f"{axis.tau:.3g} {drive.effort_unit}",
                "never" if math.isinf(silent) else f"{silent:.1f} s",
                Marked(_alarm(axis)),
            )
        )
    columns: tuple[str | Column, ...] = (
        Column("axis", folds=True),
        "node",
        Column("NMT", folds=True),
        Column("state", folds=True),
        *figures("position", "torque", "heard"),
        Column("emergency", folds=True),
    )
    return table(f"SYNC at {rate:.4g} Hz" if rate else "no SYNC", columns, rows)


def _position(drive: AxisDrive, q: float) -> str:
    return f"{1000 * q:.2f} mm" if drive.joint == "prismatic" else f"{math.degrees(q):.2f}°"


def _alarm(axis: AxisPicture) -> str:
    parts = [str(axis.emergency)] if axis.emergency else []
    if axis.emergencies:
        parts.append(f"{axis.emergencies} in all")
    if axis.foreign:
        parts.append(f"{axis.foreign} TPDOs of unexpected length")
    return "; ".join(parts)
