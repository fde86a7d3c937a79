"""Slow rehearsal of a plan's motions without recordings: the first run on a robot.

A measurement needs its own speed, so a slow campaign would measure nothing useful. A rehearsal
passes every path of the plan once, below a share of each axis's limit: all travels, a stroke there
and back of each measurement, and for a coupling the strokes of both axes in turn. A motion slowed
by a factor s has its velocity times s and its acceleration times s^2, so that several axes follow
exactly the path of a motion at full speed. Supervision and trips are those of a measuring run; the
operator's hand is on the stop.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.measuring import REHEARSAL_SPEED
from hil.measuring.events import Finished, Paused, Rehearsed, Started, Travelled
from hil.measuring.sequencer import hold, never, refuse_other_bus
from hil.measuring.streaming import pace, pass_slowly
from hil.measuring.travel import locate, pass_along, travel
from hil.planning.strokes import TURN
from hil.planning.timetable import SETTLING, travel_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from drivers.drive_bus import DriveBus
    from hil.measuring.events import Event
    from hil.model.robot import Robot
    from hil.planning.measurement import Measurement
    from hil.planning.plan import Plan
    from hil.planning.strokes import Strokes
    from hil.planning.trapezoid import Trapezoid


def rehearse(
    plan: Plan,
    robot: Robot,
    bus: DriveBus,
    speed: float = REHEARSAL_SPEED,
    pause: Callable[[], bool] = never,
) -> Iterator[Event]:
    """Rehearse all motions of `plan`.

    Parameters
    ----------
    bus : DriveBus
        Bus entered and left by the caller.
    speed : float
        Largest share of each axis's velocity limit in any motion.
    pause : callable
        As in `hil.measuring.sequencer.measure`.

    Yields
    ------
    Event
        Started, Travelled, Rehearsed, Paused and Finished.

    Raises
    ------
    DriveError
        Errors as in a measurement at full speed.
    """
    refuse_other_bus(plan, robot, bus)
    here = locate(bus)
    left = _durations(plan, robot, here.q, speed)
    number = len(left)
    yield Started(here.time, sum(left), number, number)
    slow = min(1.0, speed / plan.travel)
    for measurement in plan.measurements:
        now = travel(bus, robot, measurement.start, plan.travel, plan.workspace, slow)
        yield Travelled(now.time, sum(left), measurement)
        if measurement.streamed:
            now = pass_slowly(bus, measurement, pace(measurement, robot, speed))
        else:
            for index, profile in _slowed(measurement, robot, speed):
                now = pass_along(bus, index, profile, measurement.id)
        left.pop(0)
        yield Rehearsed(now.time, sum(left), measurement)
        if pause():
            yield Paused(now.time, sum(left))
            hold(bus, pause)
    yield Finished(locate(bus).time, 0.0, number, ())


def _slowed(measurement: Strokes, robot: Robot, speed: float) -> Iterator[tuple[int, Trapezoid]]:
    """Yield strokes there and back of single axes, no faster than `speed` allows."""
    ways = [(measurement.index, measurement.profile(k)) for k in (0, 1)]
    for partner in measurement.partners:
        ways[1:1] = [(partner.index, partner.profile(measurement.q, k)) for k in (0, 1)]
    for index, profile in ways:
        slow = min(1.0, speed * float(robot.velocity_limit[index]) / profile.velocity)
        yield (
            index,
            replace(
                profile,
                velocity=slow * profile.velocity,
                acceleration=slow**2 * profile.acceleration,
            ),
        )


def _durations(plan: Plan, robot: Robot, start: Sequence[float], speed: float) -> list[float]:
    """Return the expected durations of the measurements, including travel [s]."""
    slow = min(1.0, speed / plan.travel)
    durations, here = [], start
    for measurement in plan.measurements:
        way = travel_time(robot, here, measurement.start, plan.travel) / slow + SETTLING
        durations.append(way + _duration(measurement, robot, speed))
        here = measurement.start
    return durations


def _duration(measurement: Measurement, robot: Robot, speed: float) -> float:
    """Return the expected duration of a measurement's own motions [s]."""
    if measurement.streamed:
        return measurement.period / pace(measurement, robot, speed)
    strokes = [profile.duration for _, profile in _slowed(measurement, robot, speed)]
    return sum(strokes) + TURN * len(strokes)
