"""A table of what goes on on the bus, drawn again and again until a key ends it.

Where nobody sits at a terminal the table is printed once, when the time is over.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

from rich.live import Live
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rich.console import Console

    from hil.terminal.keys import Keys

REDRAWN = 0.1
"""Time between two tables [s]."""


class AxisLine(NamedTuple):
    """One axis in words; `alarm` is shown in red."""

    axis: str
    node: str
    nmt: str
    state: str
    position: str
    torque: str
    heard: str
    alarm: str


class Snapshot(NamedTuple):
    """What was seen until now: a row an axis, and the rate of SYNC [1/s]."""

    rows: Sequence[AxisLine]
    sync_rate: float


def follow(
    listen: Callable[[float], None],
    snapshot: Callable[[], Snapshot],
    keys: Keys,
    console: Console,
    duration: float | None,
) -> None:
    """Listen and show what is seen until q is pressed or the time is over.

    Parameters
    ----------
    listen : callable
        Takes frames for so long [s].
    snapshot : callable
        What was seen until now.
    keys : Keys
        Entered; p pauses the table and goes on, q ends.
    console : Console
        Where to draw.
    duration : float or None
        How long at most [s].
    """
    ends = None if duration is None else time.monotonic() + duration
    paused = False
    if not console.is_terminal:
        while ends is None or time.monotonic() < ends:
            listen(REDRAWN)
        console.print(table(snapshot(), ""))
        return
    with Live(console=console, auto_refresh=False, transient=False) as live:
        while ends is None or time.monotonic() < ends:
            listen(REDRAWN)
            pressed = keys.pressed().lower()
            if "q" in pressed:
                return
            paused ^= pressed.count("p") % 2 == 1
            if not paused:
                shown = table(snapshot(), "p pauses, q quits")
            else:
                shown.caption = "paused: p goes on, q quits"
            live.update(shown, refresh=True)


def table(snapshot: Snapshot, hint: str) -> Table:
    """Draw one table."""
    rate = f"SYNC at {snapshot.sync_rate:.4g} Hz" if snapshot.sync_rate else "no SYNC"
    drawn = Table(title=rate, caption=hint)
    for heading in ("axis", "node", "NMT", "state"):
        drawn.add_column(heading)
    for heading in ("position", "torque", "heard"):
        drawn.add_column(heading, no_wrap=True, justify="right")
    drawn.add_column("emergency")
    for row in snapshot.rows:
        drawn.add_row(*row[:-1], Text(row.alarm, style="bold red"))
    return drawn
