"""Live display of torques and thresholds; plain lines without a terminal."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Group
from rich.live import Live
from rich.text import Text

from hil.show.rounding import clock, significant
from hil.show.table import Marked, figures, table
from hil.show.terminal import Drawn
from hil.terminal.console import say
from hil.terminal.progress import doing, shown
from hil.watching.watcher import describe_alarm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import Console

    from hil.measuring.events import Event
    from hil.model.robot import Robot
    from hil.results.watch import Alarm
    from hil.watching.watcher import Watcher


class WatchView:
    """Display of new alarms, and of all axes' torques on a terminal.

    Parameters
    ----------
    watcher : Watcher
    robot : Robot
    """

    def __init__(self, watcher: Watcher, robot: Robot) -> None:
        self._watcher = watcher
        self._robot = robot
        self._live: Live | None = None
        self._next = 0.0
        self._doing = ""

    def take(self, alarm: Alarm | None, period: float = 0.1) -> None:
        """Show an alarm; redraw the table after a period [s]."""
        if alarm is not None:
            say(describe_alarm(alarm, self._watcher.unit(alarm)), style="bold red")
        if self._live is not None and time.monotonic() >= self._next:
            self._next = time.monotonic() + period
            self._live.update(self.draw(), refresh=True)

    @contextmanager
    def display(self, console: Console) -> Iterator[Callable[[Event], None]]:
        """Show events; yield the function for events."""
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
        self._doing = f"{doing(event)}, {clock(event.remaining)} of robot time left"

    def draw(self) -> Group:
        """Draw torques and thresholds of all axes, and the present measurement."""
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
