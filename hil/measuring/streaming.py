"""Streaming of a trajectory on a `StreamingBus`, with a recording or slowly in a rehearsal."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import DriveRefused, MoveFailed, StreamingBus
from hil.measuring.checks.encoder_jumps import finished
from hil.measuring.travel import GRACE
from hil.planning.strokes import REST
from hil.runs.recording import IDLE, Finding, Recorder
from hil.runs.set_points import path_time

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.drive_bus import DriveBus, Sample
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory
    from hil.runs.recording import Recording

ASTRAY = 0.05
"""Maximum distance of an axis from its set-point at the same SYNC [rad or m]."""


def stream(bus: DriveBus, trajectory: Trajectory) -> Recording:
    """Carry out and record all periods of a trajectory, including the start.

    Samples of period k are group k. The recorded position along the trajectory is that of the
    set-points, since drives may have passed the trajectory more slowly.

    Raises
    ------
    DriveRefused
        The bus supports no streamed set-points.
    MoveFailed
        The axes did not rest at the end in time.
    Tripped
        An encoder jumped.
    """
    recorder, period = Recorder(), IDLE
    rest = round(REST / bus.period)
    for sample, along in _followed(bus, trajectory, 1.0):
        t = (along - rest) * bus.period
        number = math.floor((t + bus.period / 2) / trajectory.period)  # by the nearest sample
        number = number if 0 <= number < trajectory.cycles else IDLE
        if number != period:
            recorder.mark("group", period := number)
        recorder.add(sample, t)
    _, _, acceleration = trajectory.motion(np.linspace(0.0, trajectory.period, 1000))
    return finished(bus, recorder, float(np.abs(acceleration).max()))


def pass_slowly(bus: DriveBus, trajectory: Trajectory, slow: float) -> Sample:
    """Run one period at `slow` times its speed, unrecorded; return the last sample."""
    for sample, _ in _followed(bus, trajectory.once, slow):
        last = sample
    return last


def pace(trajectory: Trajectory, robot: Robot, speed: float) -> float:
    """Return the speed factor that keeps a trajectory below the share `speed` of the limits."""
    t = np.linspace(0.0, trajectory.period, 1000)
    highest = float(np.max(np.abs(trajectory.motion(t)[1]) / robot.velocity_limit))
    return min(1.0, speed / highest) if highest > 0 else 1.0


def astray(recording: Recording, trajectory: Trajectory, robot: Robot) -> Iterator[Finding]:
    """Yield a finding of an axis that did not follow the path."""
    # a drive without delay reaches a set-point one SYNC period after the start of its interpolation
    t = path_time(recording, 1.0)
    away = np.abs(recording.q - trajectory.motion(trajectory.within(t))[0])
    worst = np.nan_to_num(away).max(axis=0)
    axis = int(worst.argmax())
    if worst[axis] > ASTRAY:
        unit = robot.position_unit(axis)
        yield Finding(
            "astray",
            f"axis {axis + 1} is up to {worst[axis]:.3g} {unit} away from its set-points, at "
            f"most {ASTRAY} {unit} allowed; plan a slower trajectory or check the drive's tuning",
            float(worst[axis]),
            ASTRAY,
        )


def _followed(bus: DriveBus, trajectory: Trajectory, slow: float) -> Iterator[tuple[Sample, float]]:
    """Yield samples with the index of the set-points active from their SYNC on."""
    if not isinstance(bus, StreamingBus):
        raise DriveRefused(
            f"{trajectory.id}: these drives accept no cyclic set-points; plan measurements of "
            "strokes instead"
        )
    path = trajectory.path(slow * bus.period)
    bus.stream(path.tolist())
    reached, arrived = False, math.inf
    while not reached:
        sample = bus.sample()
        reached = sample.reached
        yield sample, bus.path_index
        if bus.path_index >= len(path) - 1:
            arrived = min(arrived, sample.time)
        if sample.time - arrived > GRACE:
            bus.halt()
            raise MoveFailed(
                f"{trajectory.id}: not at rest {GRACE:g} s after its end; check for a blocked "
                "axis or too small a position window"
            )
