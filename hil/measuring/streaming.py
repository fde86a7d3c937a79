"""Streaming a trajectory on a `StreamingBus`, recording it, or passing it slowly in a rehearsal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import DriveRefused, MoveFailed, StreamingBus
from hil.measuring.checks.encoder_jumps import finished
from hil.measuring.travel import GRACE
from hil.planning.strokes import REST
from hil.runs.recording import Finding, Recorder

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drive_bus import DriveBus, Sample
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory
    from hil.runs.recording import Recording

ASTRAY = 0.05
"""How far an axis may be from its set-point at the same SYNC [rad or m]."""


def stream(bus: DriveBus, trajectory: Trajectory) -> Recording:
    """Carry out all periods of a trajectory from where it starts, and record every sample.

    Samples of period k are group k.

    Raises
    ------
    DriveRefused
        The bus takes no streams of set-points.
    MoveFailed
        Not at rest at the end in time.
    Tripped
        An encoder jumped.
    """
    recorder = Recorder()
    first = round(REST / bus.period)
    begins = [first + round(k * trajectory.period / bus.period) for k in range(trajectory.cycles)]
    marks = {begin: k for k, begin in enumerate(begins)}
    marks[first + round(trajectory.cycles * trajectory.period / bus.period)] = -1
    for number, sample in enumerate(_followed(bus, trajectory, 1.0)):
        if number in marks:
            recorder.group(marks[number])
        recorder.add(sample)
    _, _, acceleration = trajectory.motion(np.linspace(0.0, trajectory.period, 1000))
    return finished(bus, recorder, float(np.abs(acceleration).max()))


def pass_slowly(bus: DriveBus, trajectory: Trajectory, slow: float) -> Sample:
    """Pass one period at `slow` times its speed, recording nothing; return the last sample."""
    for sample in _followed(bus, trajectory.once, slow):
        last = sample
    return last


def pace(trajectory: Trajectory, robot: Robot, speed: float) -> float:
    """Share of its own speed at which a trajectory keeps below `speed` of the limits."""
    t = np.linspace(0.0, trajectory.period, 1000)
    highest = float(np.max(np.abs(trajectory.motion(t)[1]) / robot.velocity_limit))
    return min(1.0, speed / highest) if highest > 0 else 1.0


def astray(recording: Recording, trajectory: Trajectory, robot: Robot) -> Iterator[Finding]:
    """Find where an axis did not follow the path."""
    period = round(recording.period, 9)
    index = np.rint((recording.time - recording.time[0]) / period).astype(int)
    path = trajectory.path(period)
    away = np.abs(recording.q - path[np.minimum(index, len(path) - 1)])
    worst = np.nan_to_num(away).max(axis=0)
    axis = int(worst.argmax())
    if worst[axis] > ASTRAY:
        unit = robot.position_unit(axis)
        yield Finding(
            "astray",
            f"axis {axis + 1} is up to {worst[axis]:.3g} {unit} away from its set-points, at most"
            f" {ASTRAY} {unit} may be; plan a slower trajectory or check the drive's tuning",
            float(worst[axis]),
            ASTRAY,
        )


def _followed(bus: DriveBus, trajectory: Trajectory, slow: float) -> Iterator[Sample]:
    if not isinstance(bus, StreamingBus):
        raise DriveRefused(
            f"{trajectory.id}: these drives follow no stream of set-points; plan measurements of"
            " strokes instead"
        )
    bus.stream(trajectory.path(slow * bus.period).tolist())
    sample = bus.sample()
    deadline = sample.time + trajectory.duration / slow + GRACE
    yield sample
    while not sample.reached:
        sample = bus.sample()
        yield sample
        if sample.time > deadline:
            bus.halt()
            raise MoveFailed(
                f"{trajectory.id}: not at rest {GRACE:g} s after its end; see whether an axis is"
                " blocked or its position window too small"
            )
