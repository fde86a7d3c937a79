"""Motions on a `DriveBus`: travelling between configurations and the strokes of a measurement.

Time passes only in `bus.sample()`, and every time-out counts in the bus's time. A travel moves all
axes at once, each with its own trapezoid, so the robot stays inside the box in joint space that
start and target span; a box inside the limits is all that has to be checked, and in a guarded
workspace the path within it. Strokes follow each other as soon as the bus says that the axis
stands still at its target.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import LimitExceeded, Move, MoveFailed
from hil.measuring.checks.encoder_jumps import refuse_jumps
from hil.planning.measurement import PARTNER_TURN, REST, SETTLED, Coupling
from hil.planning.path_clearance import refuse_travel
from hil.planning.timetable import travel_time
from hil.planning.workspace import narrowed
from hil.runs.recording import IDLE, Recorder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drive_bus import DriveBus, Sample
    from hil.model.robot import Robot
    from hil.planning.measurement import Strokes
    from hil.planning.trapezoid import Trapezoid
    from hil.planning.workspace import Workspace
    from hil.runs.recording import Recording

OVERDUE = 1.5
"""A move may take this many times its expected duration, plus `GRACE`."""
GRACE = 5.0
"""Time for handshake and settling before a move counts as failed [s]."""
SLACK = 2e-3
"""A robot may stand this far outside its limits and still travel back inside [rad]."""


def locate(bus: DriveBus) -> Sample:
    """Find out where the axes stand.

    Raises
    ------
    MoveFailed
        An axis tells no position within 20 samples.
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
    """Move all axes at once to `target` [rad] and wait until they stand still.

    Parameters
    ----------
    fraction : float
        Share of the velocity and acceleration limits.
    workspace : Workspace, optional
        What the arm must keep clear of.
    slow : float
        Pace at which the same path is passed; 0.5 takes twice as long.

    Returns
    -------
    Sample
        The first one at rest.

    Raises
    ------
    LimitExceeded
        The path leaves the robot's limits or the workspace; nothing was commanded.
    MoveFailed
        Not at rest at the target in time.
    Tripped
        An encoder jumped.
    """
    here = locate(bus)
    _check_box(narrowed(robot, workspace), here.q, target)
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
    last = _until_reached(bus, recorder.add, here.time, expected, "travel")
    highest = max(move.acceleration for move in moves.values())
    refuse_jumps(recorder.finish(), highest, _resolution(bus))
    return last


def pass_along(bus: DriveBus, index: int, profile: Trapezoid, what: str) -> Sample:
    """Move one axis along `profile`, recording nothing; return the first sample at rest.

    Raises
    ------
    MoveFailed
        Not at rest at the end in time; `what` says what it was for.
    Tripped
        An encoder jumped.
    """
    recorder = Recorder()
    begin = locate(bus).time
    bus.move({index: Move(profile.end, profile.velocity, profile.acceleration)})
    last = _until_reached(bus, recorder.add, begin, profile.duration, what)
    refuse_jumps(recorder.finish(), profile.acceleration, _resolution(bus))
    return last


def record(bus: DriveBus, measurement: Strokes) -> Recording:
    """Carry out the strokes of a measurement and record every sample.

    The axes stand at ``measurement.start``, where the last stroke brings them back to.

    Raises
    ------
    MoveFailed
        A stroke not finished in time.
    Tripped
        An encoder jumped.
    """
    recorder = Recorder()
    last = _rest(bus, recorder)
    partner = _PartnerStrokes(bus, recorder, measurement) if _has_partner(measurement) else None
    for number in range(measurement.n_strokes):
        profile = measurement.profile(number)
        recorder.stroke(number)
        bus.move({measurement.index: Move(profile.end, profile.velocity, profile.acceleration)})
        each = recorder.add
        if partner:
            partner.begin(last.time + profile.window[0], last.time + profile.window[1])
            each = partner.add
        what = f"{measurement.id}, stroke {number + 1}"
        last = _until_reached(bus, each, last.time, profile.duration, what)
    recorder.stroke(IDLE)
    recorder.partner_stroke(IDLE)
    _rest(bus, recorder)
    recording = recorder.finish()
    refuse_jumps(recording, _highest_acceleration(measurement), _resolution(bus))
    return recording


def stand(bus: DriveBus, duration: float) -> Sample:
    """Let `duration` [s] pass without a motion; return the last sample."""
    begin = last = locate(bus)
    while last.time - begin.time < duration:
        last = bus.sample()
    return last


class _PartnerStrokes:
    """Sends the partner back and forth while the other axis creeps.

    The bus tells only when all axes have arrived, so the partner's turns go by its profile's
    duration. No stroke begins that would not end before the creeping axis brakes.
    """

    def __init__(self, bus: DriveBus, recorder: Recorder, measurement: Strokes) -> None:
        assert isinstance(measurement, Coupling)  # noqa: S101 - see _has_partner
        self._bus = bus
        self._recorder = recorder
        self._measurement = measurement
        self._number = 0
        self._due = self._last = 0.0

    def begin(self, earliest: float, latest: float) -> None:
        """Allow strokes that lie between two instants [s]."""
        self._recorder.partner_stroke(IDLE)
        self._due = earliest + SETTLED
        self._last = latest - self._measurement.partner_profile(0).duration - PARTNER_TURN

    def add(self, sample: Sample) -> None:
        """Take one sample and start a stroke when one is due."""
        self._recorder.add(sample)
        if sample.time >= self._due:
            if sample.time > self._last:
                self._recorder.partner_stroke(IDLE)
                self._due = math.inf
            else:
                self._start(sample.time)

    def _start(self, now: float) -> None:
        profile = self._measurement.partner_profile(self._number)
        move = Move(profile.end, profile.velocity, profile.acceleration)
        self._recorder.partner_stroke(self._number)
        self._bus.move({self._measurement.partner.index: move})
        self._number += 1
        self._due = now + profile.duration + PARTNER_TURN


def _has_partner(measurement: Strokes) -> bool:
    return isinstance(measurement, Coupling)


def _resolution(bus: DriveBus) -> list[float]:
    return [axis.position_resolution for axis in bus.axes]


def _highest_acceleration(measurement: Strokes) -> float:
    partner = measurement.partner.acceleration if isinstance(measurement, Coupling) else 0.0
    return max(measurement.acceleration, partner)


def _rest(bus: DriveBus, recorder: Recorder) -> Sample:
    """Record samples at rest, padding for the filters; return the last one."""
    for _ in range(max(1, round(REST / bus.period))):
        sample = bus.sample()
        recorder.add(sample)
    return sample


def _until_reached(
    bus: DriveBus,
    each: Callable[[Sample], None],
    begin: float,
    expected: float,
    what: str,
) -> Sample:
    deadline = begin + OVERDUE * expected + GRACE
    next_sample = bus.sample
    while True:
        sample = next_sample()
        each(sample)
        if sample.reached:
            return sample
        if sample.time > deadline:
            bus.halt()
            raise MoveFailed(
                f"{what}: not at rest at the target after {sample.time - begin:.3g} s, expected"
                f" {expected:.3g} s; see whether an axis is blocked or its position window and"
                " velocity limit are too small"
            )


def _check_box(robot: Robot, here: Sequence[float], target: Sequence[float]) -> None:
    limits = zip(robot.q_min, robot.q_max, strict=True)
    for index, (low, high) in enumerate(limits):
        if not low <= target[index] <= high:
            raise LimitExceeded(
                f"axis {index + 1}: target {target[index]:.4g} rad is outside {low:.4g} ..."
                f" {high:.4g} rad; correct the plan"
            )
        if not low - SLACK <= here[index] <= high + SLACK:
            raise LimitExceeded(
                f"axis {index + 1}: stands at {here[index]:.4g} rad, outside {low:.4g} ..."
                f" {high:.4g} rad; bring it inside with the drive's own tool, or check its"
                " position offset in drives.yaml"
            )
