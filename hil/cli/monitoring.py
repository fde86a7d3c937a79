"""Live displays: of the drives on a bus for `hil drives monitor`, and of torques for `hil watch`.

The table of drives refreshes until a key ends the command. Without a terminal it is printed once,
at the end, and the display of torques and thresholds is plain lines.
"""

from __future__ import annotations

import math
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

from rich.console import Group
from rich.live import Live
from rich.text import Text
from typer import Option

from hil.cli.arguments import Drives, DrivesBus, expand_records
from hil.show.rounding import clock, significant
from hil.show.table import Column, Marked, figures, table
from hil.show.terminal import Drawn, show
from hil.terminal.console import out, say
from hil.terminal.keys import Keys, interruptible

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import Console

    from drivers.cia402.picture import Picture
    from drivers.drives_file import DrivesFile
    from hil.measuring.sequencer import Event
    from hil.model.robot import Robot
    from hil.results.watch import Alarm
    from hil.show.table import Table
    from hil.watching.watcher import Watcher


@expand_records
def monitor(
    drives_file: Drives,
    where: DrivesBus,
    duration: Annotated[
        float | None,
        Option("--for", min=0.1, help="Duration of monitoring; unlimited by default \\[s]."),
    ] = None,
    inputs: Annotated[
        bool,
        Option(
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
        follow(picture.listen, lambda: _table(picture, drives), keys, out, duration)


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
        parts = [str(axis.emergency)] if axis.emergency else []
        if axis.emergencies:
            parts.append(f"{axis.emergencies} in all")
        if axis.foreign:
            parts.append(f"{axis.foreign} TPDOs of unexpected length")
        rows.append(
            (
                axis.name,
                str(axis.node),
                axis.nmt,
                ", ".join(filter(None, (axis.state and axis.state.value, axis.interlock))),
                ""
                if math.isnan(axis.q)
                else f"{1000 * axis.q:.2f} mm"
                if drive.joint == "prismatic"
                else f"{math.degrees(axis.q):.2f}°",
                "" if math.isnan(axis.tau) else f"{axis.tau:.3g} {drive.effort_unit}",
                "never" if math.isinf(silent) else f"{silent:.1f} s",
                Marked("; ".join(parts)),
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


class WatchView:
    """Display of new alarms, and of the axes' torques on a terminal."""

    def __init__(self, watcher: Watcher, robot: Robot) -> None:
        self._watcher = watcher
        self._robot = robot
        self._live: Live | None = None
        self._next = 0.0
        self._doing = ""

    def take(self, alarm: Alarm | None, period: float = 0.1) -> None:
        """Show an alarm; redraw the table after a period [s]."""
        if alarm is not None:
            from hil.watching.watcher import describe_alarm

            say(describe_alarm(alarm, self._watcher.unit(alarm)), style="bold red")
        if self._live is not None and time.monotonic() >= self._next:
            self._next = time.monotonic() + period
            self._live.update(self.draw(), refresh=True)

    @contextmanager
    def display(self, console: Console) -> Iterator[Callable[[Event], None]]:
        """Show events; yield the function for events."""
        from hil.terminal.progress import shown

        if not console.is_terminal:
            with shown(console) as show:
                yield show
            return
        with Live(console=console, auto_refresh=False, transient=True) as live:
            self._live = live
            try:
                yield self._note
            finally:
                self._live = None

    def _note(self, event: Event) -> None:
        from hil.terminal.progress import doing

        self._doing = f"{doing(event)}, {clock(event.remaining)} of robot time left"

    def draw(self) -> Group:
        """Draw torques and thresholds of the axes, and the present measurement."""
        watcher = self._watcher
        state = "learning thresholds, no alarms yet" if watcher.learning else "watching"
        heads = figures("measured", "predicted", "external", "threshold", "last alarm")
        last = {alarm.axis: alarm for alarm in watcher.alarms}
        rows = []
        for axis, torques in enumerate(watcher.torques(), start=1):
            cells = (significant(torque, 3) for torque in torques)
            alarm = last.get(axis)
            text = "" if alarm is None else f"{alarm.peak:+.3g} at {alarm.time:.1f} s"
            unit = self._robot.torque_unit(axis - 1)
            rows.append((f"{axis}, {unit}", *cells, Marked(text)))
        drawn = Drawn(table(f"{state}, {len(watcher.alarms)} alarms", ("axis", *heads), rows))
        return Group(drawn, Text(self._doing))
