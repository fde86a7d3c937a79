"""Motions on a `DriveBus`: travels between configurations, single strokes, streamed trajectories.

Time passes only in `bus.sample()`, and every time-out is in the bus's time. A travel moves all axes
simultaneously with separate trapezoids, so the robot stays inside the box in joint space spanned by
start and target; it is sufficient to check that the box is within the limits and, with a guarded
workspace, that the path is within the workspace.

A trajectory is streamed on a `StreamingBus`, with a recording or slowly in a rehearsal.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import DriveRefused, LimitExceeded, Move, MoveFailed, StreamingBus
from hil.measuring.checks.encoder_jumps import finished
from hil.planning.strokes import REST
from hil.planning.timetable import refuse_travel, travel_time
from hil.planning.workspace import narrow_ranges
from hil.runs.recording import IDLE, Finding, Recorder
from hil.runs.set_points import path_time

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from drivers.drive_bus import DriveBus, Sample
    from hil.model.robot import Robot
    from hil.planning.trajectory import Trajectory
    from hil.planning.trapezoid import Trapezoid
    from hil.planning.workspace import Workspace
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
    """Run one period at `slow` times the speed, unrecorded; return the last sample."""
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


GRACE = 5.0
"""Time for handshake and settling before a move counts as failed [s]."""
SLACK = 2e-3
"""Maximum distance of a robot outside its limits for a travel back inside [rad or m]."""


def locate(bus: DriveBus) -> Sample:
    """Return a sample with the positions of the axes.

    Raises
    ------
    MoveFailed
        An axis reports no position within 20 samples.
    """
    for _ in range(20):
        sample = bus.sample()
        if all(math.isfinite(q) for q in sample.q):
            return sample
    silent = ", ".join(str(i + 1) for i, q in enumerate(sample.q) if not math.isfinite(q))
    raise MoveFailed(
        f"axis {silent}: no position in 20 samples, so nothing was moved; check wiring and PDO"
        " mapping of that drive"
    )


def travel(
    bus: DriveBus,
    robot: Robot,
    target: Sequence[float],
    fraction: float,
    workspace: Workspace | None = None,
    slow: float = 1.0,
) -> Sample:
    """Move all axes simultaneously to `target` [rad or m] and wait for rest.

    Parameters
    ----------
    fraction : float
        Share of the velocity and acceleration limits.
    workspace : Workspace, optional
        Workspace of the arm.
    slow : float
        Pace along the path; 0.5 takes twice as long.

    Returns
    -------
    Sample
        First sample at rest.

    Raises
    ------
    LimitExceeded
        The path leaves the robot's limits or the workspace; nothing has moved.
    MoveFailed
        The axes did not rest at the target in time.
    Tripped
        An encoder jumped.
    """
    here = locate(bus)
    narrowed = narrow_ranges(robot, workspace)
    for index, (low, high) in enumerate(zip(narrowed.q_min, narrowed.q_max, strict=True)):
        unit = robot.position_unit(index)
        if not low <= target[index] <= high:
            raise LimitExceeded(
                f"axis {index + 1}: target {target[index]:.4g} {unit} is outside {low:.4g} ..."
                f" {high:.4g} {unit}; correct the plan"
            )
        if not low - SLACK <= here.q[index] <= high + SLACK:
            raise LimitExceeded(
                f"axis {index + 1}: is at {here.q[index]:.4g} {unit}, outside {low:.4g} ... "
                f"{high:.4g} {unit}; move the axis inside with the drive's own tool, or check "
                "the position offset in drives.yaml"
            )
    refuse_travel(robot, workspace, here.q, target, fraction)
    moves = {
        index: Move(
            float(target[index]),
            slow * fraction * float(robot.velocity_limit[index]),
            slow**2 * fraction * float(robot.acceleration_limit[index]),
        )
        for index in range(robot.n_joints)
    }
    bus.move(moves)
    expected = travel_time(robot, here.q, target, fraction) / slow
    recorder = Recorder()
    last = until_reached(bus, recorder.extend, here.time, expected, "travel")
    highest = max(move.acceleration for move in moves.values())
    finished(bus, recorder, highest)
    return last


def pass_along(bus: DriveBus, index: int, profile: Trapezoid, what: str) -> Sample:
    """Move an axis along `profile` without a recording; return the first sample at rest.

    Raises
    ------
    MoveFailed
        The axis did not rest at the end in time; `what` is the purpose of the motion.
    Tripped
        An encoder jumped.
    """
    recorder = Recorder()
    begin = locate(bus).time
    bus.move({index: Move(profile.end, profile.velocity, profile.acceleration)})
    last = until_reached(bus, recorder.extend, begin, profile.duration, what)
    finished(bus, recorder, profile.acceleration)
    return last


def stand(bus: DriveBus, duration: float) -> Sample:
    """Let `duration` [s] pass without a motion; return the last sample."""
    begin = last = locate(bus)
    while (left := duration - (last.time - begin.time)) > 0:
        last = bus.samples(max(1, int(left / bus.period)))[-1]
    return last


def until_reached(
    bus: DriveBus,
    take: Callable[[Sequence[Sample]], float | None],
    begin: float,
    expected: float,
    what: str,
) -> Sample:
    """Pass samples to `take` until all axes rest at the targets; return the last sample.

    Parameters
    ----------
    take : callable
        Function that returns the instant of its next command [s]; None if there is none.
    begin, expected : float
        Start and expected duration of the motion [s].
    what : str
        Description of the motion for messages.

    Raises
    ------
    MoveFailed
        The axes did not rest at the targets in time.
    """
    # half as long again as expected, and `GRACE`
    deadline = begin + 1.5 * expected + GRACE
    limit = 1
    while True:
        taken = bus.samples(limit)
        due, sample = take(taken), taken[-1]
        if sample.reached:
            return sample
        if sample.time > deadline:
            bus.halt()
            raise MoveFailed(
                f"{what}: not at rest at the target after {sample.time - begin:.3g} s, expected "
                f"{expected:.3g} s; check for a blocked axis, or too small a position window or "
                "velocity limit"
            )
        idle = (deadline if due is None else min(due, deadline)) - sample.time
        limit = max(1, int(idle / bus.period))
