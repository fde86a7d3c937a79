"""Feed of a run's events and samples to listening processes.

A `Feed` is connected to a run at two existing places: `wrap_bus` puts a bus in front of the drives'
bus, for samples, power and faults; `display` wraps the display of the terminal, for the sequencer's
events and the end of the run. Writing never waits, and lines to an ended process are dropped.
"""

from __future__ import annotations

import time
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING, Any

from drivers.drive_bus import DriveError
from hil.live import lines
from hil.measuring.feeding import BusInFront
from hil.measuring.sequencer import Recorded
from hil.results.watch import pushes
from hil.terminal.progress import Pace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from contextlib import AbstractContextManager
    from typing import Self

    from rich.console import Console

    from drivers.drive_bus import DriveBus, Sample
    from hil.live.audience import Audience
    from hil.measuring.sequencer import Event
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.watching.watcher import Watcher

    Take = Callable[[Event], None]
    Display = Callable[[Console], AbstractContextManager[Take]]

_LEARNING = (
    "The axes follow a motion that was not used for the model. The coloured band about each "
    "predicted torque becomes as wide as the scatter of measured torques."
)
_NOT_YET = "Do not push yet: a push now would count as scatter of the torques"
_WATCHING = (
    "Each measured torque is compared with its prediction. The band includes 95 % of normal "
    "torques; torque outside for long enough is an external torque."
)
_FOUND = (
    "Detected by motor currents and encoders only: no sensor measures the push. Red lines in the "
    "curves mark when it was found."
)
_EVERY = 1 / 25
"""Minimum interval between transmitted samples [s]."""


class Feed:
    """Feed of events to listeners, during successive runs.

    Parameters
    ----------
    simulated : bool
        True for the virtual plant.
    """

    def __init__(self, audience: Audience, *, simulated: bool) -> None:
        self._audience = audience
        self.publish = audience.publish
        self._next = 0.0
        self._simulated = simulated
        self._watcher: Watcher | None = None

    def turn_to(
        self,
        robot: Robot,
        plan: Plan,
        rehearsal: float | None,
        *,
        hand: bool,
        watcher: Watcher | None,
    ) -> None:
        """Switch to a run; later lines refer to this run.

        Parameters
        ----------
        rehearsal : float or None
            Share of the speed limits in a rehearsal.
        hand : bool
            True if the plant's arm can be pushed from the live page.
        watcher : Watcher or None
            Source of published torques.
        """
        kind = {"simulated": self._simulated, "hand": hand, "watched": watcher is not None}
        self._start = lines.start(robot, plan, rehearsal, **kind)
        self._numbers = {each.id: k for k, each in enumerate(plan.measurements, start=1)}
        self._pace, self._notes = Pace(), 0
        self._levels: dict[int, list[float]] = {}
        self._watcher, self._alarms, self._hand = watcher, 0, hand
        self._learning: bool | None = None
        # during a watch, late estimates of the previous run are discarded
        self._audience.answered = watcher is None

    def wrap_bus(self, bus: DriveBus) -> FedBus:
        """Wrap a bus, before entry."""
        return FedBus(bus, self)

    @contextmanager
    def display(self, shown: Display, console: Console) -> Iterator[Take]:
        """Show events by `shown` and publish events; yield the function for events.

        Raises
        ------
        ListenerFailed
            A listener cannot serve.
        """
        audience = self._audience
        with nullcontext() if audience.is_open else audience.open(console), shown(console) as show:
            self.publish("start", self._start)
            if self._hand and self._watcher is not None:
                self.publish("hand", {"closed": _NOT_YET})

            def take(event: Event) -> None:
                show(event)
                self.publish("event", lines.event(event, self._pace.left(event), self._numbers))
                if isinstance(event, Recorded):
                    found = lines.level(event.measurement, event.recording, self._levels)
                    if found is not None:
                        self.publish("level", found)

            yield take

    def take_sample(self, sample: Sample, notes: Sequence[str]) -> None:
        """Publish a sample if due, with new notes."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + _EVERY
        self.publish("sample", lines.sample(sample), droppable=True)
        for text in notes[self._notes :]:
            self.publish("note", {"text": text})
        self._notes = len(notes)
        if self._watcher is not None:
            self._pass_torques(self._watcher)
        self._audience.pass_on()

    def _pass_torques(self, watcher: Watcher) -> None:
        course = watcher.course()
        if len(course.time):
            line = lines.torque(range(course.measured.shape[1]), *course)
            self.publish("torque", line, droppable=True)
        if watcher.learning is not self._learning:
            self._learning = watcher.learning
            if self._hand:
                self.publish("hand", {"closed": _NOT_YET if watcher.learning else ""})
            text = "Push the arm: drag a link" if self._hand else "Watching: no push so far"
            more = _WATCHING
            if watcher.learning:
                text = f"Learning how torques scatter, {watcher.required:.0f} s of motion: do not"
                text, more = f"{text} push", _LEARNING
            self.publish("headline", {"text": text, "more": more})
        begun = watcher.alarms[self._alarms :]
        self._alarms += len(begun)
        if not begun:
            return
        found = pushes(watcher.alarms)
        for raised in begun:
            number = next(k for k, each in enumerate(found, start=1) if raised in each)
            self.publish("alarm", lines.alarm(raised, watcher.unit(raised), number))
        clearest = max(found[-1], key=lambda each: abs(each.torque) / each.threshold)
        size = f"{clearest.torque:.3g}".replace("-", "\N{MINUS SIGN}")
        text = f"Push found: axis {clearest.axis}, {size} {watcher.unit(clearest)}"
        self.publish("headline", {"text": text, "more": _FOUND})


class FedBus(BusInFront):
    """Bus in front of another bus that publishes samples and states.

    Parameters
    ----------
    bus : DriveBus
        Not entered yet.
    """

    def __init__(self, bus: DriveBus, feed: Feed) -> None:
        super().__init__(bus)
        self._feed = feed
        self._told = False

    def __enter__(self) -> Self:
        """Check, configure and power on every drive.

        The event is published with the first sample: nothing may come between powered axes and the
        code that switches them off.
        """
        try:
            super().__enter__()
        except DriveError as error:
            self._feed.publish("fault", {"text": str(error)})
            raise
        return self

    def __exit__(self, *raised: Any) -> None:
        """Stop the axes and power off."""
        super().__exit__(*raised)
        self._feed.publish("off", {})

    def sample(self) -> Sample:
        """Wait for the next SYNC."""
        return self.samples(1)[0]

    def samples(self, limit: int) -> Sequence[Sample]:
        """Wait for the next SYNCs."""
        try:
            samples = self._bus.samples(limit)
        except DriveError as error:
            self._feed.publish("fault", {"text": str(error)})
            raise
        if not self._told:
            self._told = True
            self._feed.publish("armed", lines.armed(self._bus.axes))
        self._feed.take_sample(samples[-1], self._bus.notes)
        return samples
