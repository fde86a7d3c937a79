"""Progress of a campaign: a live bar on a terminal, plain lines elsewhere.

Robot time and wall time differ in lock-step, so the remaining time is scaled by the speed of robot
time so far.
"""

from __future__ import annotations

import time
from collections import deque
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, TextColumn

from hil.measuring.sequencer import (
    Finished,
    GaveUp,
    Paused,
    Preparing,
    Recorded,
    Rehearsed,
    Repeated,
    Started,
    Travelled,
    WarmingUp,
)
from hil.show.rounding import clock

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from rich.console import Console

    from hil.measuring.sequencer import Event


@contextmanager
def shown(console: Console) -> Iterator[Callable[[Event], None]]:
    """Show events; yield a function that receives events.

    Plain lines of progress come half a minute apart.
    """
    pace, due = Pace(), 0.0

    def print_line(event: Event) -> None:
        nonlocal due
        left = pace.left(event)
        if text := notice(event):
            console.print(text, highlight=False, soft_wrap=True)
        elif time.monotonic() >= due and not isinstance(event, Finished):
            due = time.monotonic() + 30.0
            console.print(f"{doing(event)}, {clock(left)} left", highlight=False)

    if not console.is_terminal:
        yield print_line
        return
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[left]}"))
    silent = not getattr(console, "messages", True)
    with Progress(*columns, console=console, transient=True, disable=silent) as progress:
        task = progress.add_task("starting", total=None, left="")

        def move_bar(event: Event) -> None:
            if text := notice(event):
                console.print(text, highlight=False)
            left, total = f"{clock(pace.left(event))} left", event.time + event.remaining
            progress.update(
                task, description=doing(event), completed=event.time, total=total, left=left
            )

        yield move_bar


class Pace:
    """Estimate of the remaining wall time."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque()

    def left(self, event: Event) -> float:
        """Return the remaining wall time [s]."""
        now, seen = time.monotonic(), self._seen
        seen.append((now, event.time))
        # the speed of robot time is averaged over 10 s, since the computer's load changes
        while len(seen) > 2 and now - seen[1][0] > 10.0:
            seen.popleft()
        wall, robot = now - seen[0][0], event.time - seen[0][1]
        return event.remaining * (wall / robot if robot > 0 else 1.0)


def notice(event: Event) -> str:
    """Return a message that the operator must see; empty for other events."""
    if isinstance(event, Repeated):
        reasons = "; ".join(finding.message for finding in event.findings)
        return f"{event.measurement.id}: attempt {event.attempt} is repeated: {reasons}"
    if isinstance(event, GaveUp):
        reasons = "\n  ".join(finding.message for finding in event.findings)
        return (
            f"{event.measurement.id}: kept with findings after {event.attempts} attempts:\n"
            f"  {reasons}"
        )
    if isinstance(event, Paused):
        return "paused, the axes stay under power; any key continues, s or space stops"
    return ""


def doing(event: Event) -> str:
    """Describe the current activity."""
    match event:
        case Started():
            return f"{event.pending} of {event.planned} measurements to do"
        case WarmingUp() | Preparing():
            what = "warming up"
            if isinstance(event, Preparing):
                what = f"rest and exercise before {event.measurement.id}"
            return f"{what}, {clock(event.done)} of {clock(event.duration)}"
        case Travelled() | Repeated():
            return f"measuring {event.measurement.id} ({event.measurement.kind})"
        case Rehearsed():
            return f"rehearsed {event.measurement.id} ({event.measurement.kind})"
        case Recorded() | GaveUp():
            return f"measured {event.measurement.id} ({event.measurement.kind})"
    return "paused" if isinstance(event, Paused) else "finished"
