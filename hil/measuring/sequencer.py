"""Sequencer: carries out a plan on a `DriveBus` and reports events.

The sequencer runs inside ``with bus:``, whose end always stops the axes. It never sleeps and does
not depend on the kind of bus. Each measurement is checked after its recording and repeated while it
fails, up to ``plan.attempts`` times; then the best recording is kept together with its findings.

Strokes follow one another as soon as the bus reports that the axis rests at its target. Time passes
only in `bus.sample()`, and every time-out is in the bus's time.

Of an `Event`, `time` is the bus's time, `remaining` the expected remaining robot time, both in s.
In lock-step robot time runs faster than wall time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import cycle
from math import isnan, nan
from typing import TYPE_CHECKING, Any

from drivers.drive_bus import DriveRefused, Move
from hil.measuring.checks.encoder_jumps import finished
from hil.measuring.checks.recording_checks import LASTING, SIGN, check
from hil.measuring.travel import locate, pass_along, stand, stream, travel, until_reached
from hil.planning.strokes import PARTNER_TURN, REST, SETTLED
from hil.planning.timetable import timetable
from hil.runs.recording import IDLE, Recorder

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from drivers.drive_bus import DriveBus, Sample
    from hil.model.robot import Robot
    from hil.planning.measurement import Coupling, Friction, Measurement
    from hil.planning.plan import Plan, WarmUp
    from hil.planning.strokes import Partner, Strokes
    from hil.planning.timetable import Entry
    from hil.runs.recording import Finding, Recording


@dataclass(frozen=True, slots=True)
class Event:
    """Event of a campaign."""

    time: float
    remaining: float


@dataclass(frozen=True, slots=True)
class Started(Event):
    """Start of the campaign: the robot's position is known, nothing has moved yet."""

    pending: int
    planned: int


@dataclass(frozen=True, slots=True)
class WarmingUp(Event):
    """Progress of the warm-up."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class AboutMeasurement(Event):
    """Event of a single measurement."""

    measurement: Measurement


@dataclass(frozen=True, slots=True)
class Travelled(AboutMeasurement):
    """Arrival of the axes at the start of a measurement."""


@dataclass(frozen=True, slots=True)
class Preparing(AboutMeasurement):
    """Rest or exercise of the axes before a friction measurement, `done` of `duration` [s]."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class Rehearsed(AboutMeasurement):
    """Rehearsal of a measurement's motions, without a recording."""


@dataclass(frozen=True, slots=True)
class Paused(Event):
    """Pause requested by the operator; the axes stand still under power."""


@dataclass(frozen=True, slots=True)
class Repeated(AboutMeasurement):
    """Repetition of a measurement after a recording failed its checks."""

    attempt: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class GaveUp(AboutMeasurement):
    """Failure of all attempts; the best recording follows as `Recorded`."""

    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Recorded(AboutMeasurement):
    """Completion of a measurement; `findings` is empty unless every attempt failed."""

    recording: Recording
    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Finished(Event):
    """Completion of the plan's measurements.

    `before_first` is the time of motion before the first recording kept, including warm-up and
    repeated attempts [s]; NaN without recordings.
    """

    recorded: int
    gave_up: tuple[str, ...]
    before_first: float = nan


def record(bus: DriveBus, measurement: Strokes) -> Recording:
    """Carry out the strokes of a measurement and record every sample.

    The axes start at ``measurement.start`` and return there with the last stroke.

    Raises
    ------
    MoveFailed
        A stroke was not finished in time.
    Tripped
        An encoder jumped.
    """
    return _record(bus, Recorder(), measurement, None)


def record_creep(bus: DriveBus, measurement: Coupling) -> Recording:
    """Record strokes like `record`, with a partner going back and forth in every stroke."""
    recorder = Recorder()
    partner = _PartnerStrokes(bus, recorder, measurement.q, measurement.partner)
    return _record(bus, recorder, measurement, partner)


def _record(
    bus: DriveBus, recorder: Recorder, measurement: Strokes, partner: _PartnerStrokes | None
) -> Recording:
    last = _rest(bus, recorder)
    for number in range(measurement.n_strokes):
        profile = measurement.profile(number)
        recorder.mark("stroke", number)
        bus.move({measurement.index: Move(profile.end, profile.velocity, profile.acceleration)})
        take: Callable[[Sequence[Sample]], float | None] = recorder.extend
        if partner:
            partner.begin(last.time + profile.window[0], last.time + profile.window[1])
            take = partner.take
        what = f"{measurement.id}, stroke {number + 1}"
        last = until_reached(bus, take, last.time, profile.duration, what)
    recorder.mark("stroke", IDLE)
    recorder.mark("partner_stroke", IDLE)
    _rest(bus, recorder)
    return finished(bus, recorder, measurement.highest_acceleration)


def _rest_and_exercise(bus: DriveBus, measurement: Friction) -> Iterator[tuple[float, float]]:
    """Prepare friction by rest, then motion; yield the duration so far, and the bus's time [s]."""
    begin, rest = locate(bus).time, measurement.rest or 0.0
    while (now := locate(bus).time) - begin < rest:
        # reports at least every 5 s
        now = stand(bus, min(5.0, rest - (now - begin))).time
        yield now - begin, now
    while (now := locate(bus).time) - begin < measurement.preparation:
        for number in (0, 1):
            profile = measurement.profile(number)
            now = pass_along(bus, measurement.index, profile, f"{measurement.id}, exercise").time
        yield now - begin, now


MANNERS: dict[str, Callable[[DriveBus, Any], Recording]] = {
    "gravity": record,
    "inertia": record,
    "coupling": record_creep,
    "friction": record,
    "trajectory": stream,
}
"""Functions that carry out a kind of measurement and return the recording."""
PREPARATIONS: dict[str, Callable[[DriveBus, Any], Iterator[tuple[float, float]]]] = {
    "friction": _rest_and_exercise
}
"""Preparations before the first attempt; yield their duration so far, and the bus's time [s]."""


class _PartnerStrokes:
    """Strokes of the partner while the other axis creeps.

    The bus reports only the arrival of all axes, so the partner's turns follow the duration of its
    profile. No stroke starts that would end after the creeping axis brakes.
    """

    def __init__(
        self, bus: DriveBus, recorder: Recorder, q: Sequence[float], partner: Partner
    ) -> None:
        self._bus = bus
        self._recorder = recorder
        self._q = q
        self._partner = partner
        self._number = 0
        self._due = self._last = 0.0

    def begin(self, earliest: float, latest: float) -> None:
        """Allow strokes between two instants [s]."""
        self._recorder.mark("partner_stroke", IDLE)
        self._due = earliest + SETTLED
        self._last = latest - self._partner.profile(self._q, 0).duration - PARTNER_TURN

    def take(self, samples: Sequence[Sample]) -> float:
        """Process samples and start a due stroke; return the instant of the next stroke [s]."""
        self._recorder.extend(samples)
        now = samples[-1].time
        if now >= self._due:
            if now > self._last:
                self._recorder.mark("partner_stroke", IDLE)
                self._due = math.inf
            else:
                profile = self._partner.profile(self._q, self._number)
                move = Move(profile.end, profile.velocity, profile.acceleration)
                self._recorder.mark("partner_stroke", self._number)
                self._bus.move({self._partner.index: move})
                self._number += 1
                self._due = now + profile.duration + PARTNER_TURN
        return self._due


def _rest(bus: DriveBus, recorder: Recorder) -> Sample:
    """Record samples at rest, as padding for the filters; return the last sample."""
    left = max(1, round(REST / bus.period))
    while left > 0:
        samples = bus.samples(left)
        recorder.extend(samples)
        left -= len(samples)
    return samples[-1]


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
    yield Started(here.time, left, len(pending), len(plan.measurements))
    if warm_up:
        yield from _warm_up(plan, warm_up, robot, bus, clock)
        clock.start = locate(bus).time  # the warm-up is not part of the timetable
    gave_up, before_first = [], nan
    for measurement in pending:
        arrived = travel(bus, robot, measurement.start, plan.travel, plan.workspace)
        yield Travelled(arrived.time, clock.remaining(arrived.time), measurement)
        prepare = PREPARATIONS.get(measurement.kind)
        for spent, now in prepare(bus, measurement) if prepare else ():
            left = max(0.0, clock.remaining(now) - spent)
            yield Preparing(now, left, measurement, spent, measurement.preparation)
        for event in _attempts(plan, robot, bus, measurement, clock):
            if isinstance(event, GaveUp):
                gave_up.append(measurement.id)
            elif isinstance(event, Recorded) and isnan(before_first):
                before_first = float(event.recording.time[0]) - here.time - measurement.preparation
            yield event
        if pause():
            began = locate(bus).time
            yield Paused(began, clock.remaining(began))
            clock.start += hold(bus, pause) - began
    yield Finished(locate(bus).time, 0.0, len(pending), tuple(gave_up), before_first)


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
        yield Repeated(now, clock.remaining(now), measurement, len(tries), findings)
    clock.done += 1
    left = clock.remaining(now)
    if findings:
        recording, findings = min(
            tries, key=lambda each: (len(each[1]), sum(finding.excess for finding in each[1]))
        )
        yield GaveUp(now, left, measurement, len(tries), findings)
    yield Recorded(now, left, measurement, recording, len(tries), findings)
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
            yield WarmingUp(now, left, done, warm_up.duration)


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
