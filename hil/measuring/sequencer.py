"""Sequencer: carries out a plan on a `DriveBus` and reports events.

The sequencer runs inside ``with bus:``, whose end always stops the axes. It never sleeps and does
not depend on the kind of bus. Each measurement is checked after its recording and repeated while it
fails, up to ``plan.attempts`` times; then the best recording is kept together with its findings.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import cycle
from math import isnan, nan
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused
from hil.measuring import events
from hil.measuring.checks.recording_checks import LASTING, SIGN, check
from hil.measuring.motion import MANNERS, PREPARATIONS
from hil.measuring.travel import locate, travel
from hil.planning.timetable import timetable

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from drivers.drive_bus import DriveBus
    from hil.measuring.events import Event
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan, WarmUp
    from hil.planning.timetable import Entry
    from hil.runs.recording import Finding, Recording


def never() -> bool:
    """Request no pause."""
    return False


def measure(
    plan: Plan,
    robot: Robot,
    bus: DriveBus,
    done: Collection[str] = (),
    pause: Callable[[], bool] = never,
) -> Iterator[Event]:
    """Carry out all measurements not in `done`.

    Parameters
    ----------
    plan : Plan
    robot : Robot
        Robot of the plan.
    bus : DriveBus
        Bus entered and left by the caller.
    done : collection of str
        Identifiers of measurements to skip.
    pause : callable
        Function called between measurements; while it returns True, the axes rest under power and
        are sampled.

    Yields
    ------
    Event
        Started, WarmingUp, Travelled, Preparing, Repeated, GaveUp, Recorded, Paused and Finished.

    Raises
    ------
    DriveError
        No further measurement is possible; events yielded so far remain valid.
    """
    refuse_other_bus(plan, robot, bus)
    here = locate(bus)
    pending = [m for m in plan.measurements if m.id not in done]
    clock = _Clock(timetable(plan, robot, pending, here.q), here.time)
    warm_up = plan.warm_up if pending else None
    left = clock.remaining(here.time) + (warm_up.duration if warm_up else 0.0)
    yield events.Started(here.time, left, len(pending), len(plan.measurements))
    if warm_up:
        yield from _warm_up(plan, warm_up, robot, bus, clock)
        clock.start = locate(bus).time  # the warm-up is not part of the timetable
    gave_up, before_first = [], nan
    for measurement in pending:
        arrived = travel(bus, robot, measurement.start, plan.travel, plan.workspace)
        yield events.Travelled(arrived.time, clock.remaining(arrived.time), measurement)
        prepare = PREPARATIONS.get(measurement.kind)
        for spent, now in prepare(bus, measurement) if prepare else ():
            left = max(0.0, clock.remaining(now) - spent)
            yield events.Preparing(now, left, measurement, spent, measurement.preparation)
        for event in _attempts(plan, robot, bus, measurement, clock):
            if isinstance(event, events.GaveUp):
                gave_up.append(measurement.id)
            elif isinstance(event, events.Recorded) and isnan(before_first):
                before_first = float(event.recording.time[0]) - here.time - measurement.preparation
            yield event
        if pause():
            began = locate(bus).time
            yield events.Paused(began, clock.remaining(began))
            clock.start += hold(bus, pause) - began
    yield events.Finished(locate(bus).time, 0.0, len(pending), tuple(gave_up), before_first)


@dataclass
class _Clock:
    """Clock of the remaining robot time, scaled by the timetable's accuracy so far.

    `start` is the beginning of the first entry, excluding pauses [s]; `done` the number of finished
    entries.
    """

    entries: Sequence[Entry]
    start: float
    done: int = 0

    def remaining(self, now: float) -> float:
        """Estimate the remaining robot time [s]."""
        expected = [entry.travel + entry.duration for entry in self.entries]
        past = sum(expected[: self.done])
        scale = (now - self.start) / past if past else 1.0
        return scale * sum(expected[self.done :])


def _attempts(
    plan: Plan, robot: Robot, bus: DriveBus, measurement: Measurement, clock: _Clock
) -> Iterator[Event]:
    """Record until the checks pass or the attempts are used up.

    Repetitions have no preparation: only the first attempt can have the planned motion history.
    """
    tries: list[tuple[Recording, tuple[Finding, ...]]] = []
    while True:
        recording = MANNERS[measurement.kind](bus, measurement)
        findings = tuple(check(recording, measurement, robot))
        tries.append((recording, findings))
        now = float(recording.time[-1])
        failed = {finding.check for finding in findings}
        if failed <= LASTING or SIGN in failed or len(tries) == plan.attempts:
            break
        yield events.Repeated(now, clock.remaining(now), measurement, len(tries), findings)
    clock.done += 1
    left = clock.remaining(now)
    if findings:
        recording, findings = min(
            tries, key=lambda each: (len(each[1]), sum(finding.excess for finding in each[1]))
        )
        yield events.GaveUp(now, left, measurement, len(tries), findings)
    yield events.Recorded(now, left, measurement, recording, len(tries), findings)
    for finding in findings:
        if finding.check == SIGN:
            raise DriveRefused(finding.message)


def _warm_up(
    plan: Plan, warm_up: WarmUp, robot: Robot, bus: DriveBus, clock: _Clock
) -> Iterator[Event]:
    """Travel between the plan's configurations, on checked paths, until the time is up."""
    begin = locate(bus).time
    for measurement in cycle(plan.measurements):
        for target in (measurement.start, measurement.end):
            now = travel(bus, robot, target, warm_up.fraction, plan.workspace).time
            done = now - begin
            if done >= warm_up.duration:
                return
            left = warm_up.duration - done + clock.remaining(begin)
            yield events.WarmingUp(now, left, done, warm_up.duration)


def hold(bus: DriveBus, pause: Callable[[], bool]) -> float:
    """Let time pass while `pause` requests it; return the bus's time at the end [s]."""
    now = locate(bus).time
    while pause():
        now = bus.sample().time
    return now


def refuse_other_bus(plan: Plan, robot: Robot, bus: DriveBus) -> None:
    """Refuse a bus with other axes or another sample period than the plan's.

    Raises
    ------
    DriveRefused
        Message with the difference.
    """
    if len(bus.axes) != robot.n_joints:
        raise DriveRefused(
            f"the bus has {len(bus.axes)} axes, {robot.name} has {robot.n_joints} joints; list one"
            " axis for each joint in drives.yaml"
        )
    if abs(bus.period - plan.sample_period) > 1e-9:
        raise DriveRefused(
            f"the bus samples every {bus.period:g} s, the plan wants {plan.sample_period:g} s; "
            "set sample_period in the plan and sync_period in drives.yaml to one value"
        )
