"""Profile position mode: set-points of the axes from the handshake to the target or a failure.

Profile velocity and acceleration are sent by SDO, only when changed; the target is sent by RPDO
with the controlword that makes it valid, so a move with an unchanged profile costs one frame.

Some drives hold the acknowledge bit until the target is reached, as the handshake allows (stated in
the drives file: ``acknowledge: reached``). The whole motion may then pass before the bit falls, and
a further set-point waits until the previous one has reached its target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402.objects import PROFILE_ACCELERATION, PROFILE_DECELERATION, PROFILE_VELOCITY
from drivers.cia402.set_point import (
    ENABLED,
    HALTED,
    HaltedAxis,
    Phase,
    SetPoint,
    Standstill,
    standstill_of,
)
from drivers.cia402.states import Status
from drivers.drive_bus import MoveFailed, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import Cycles, ProcessData
    from drivers.drive_bus import Move

ACKNOWLEDGE_CYCLES = 25
"""Minimum duration of the handshake [SYNCs]: four statuswords must come and go."""

GRACE = 2.0
"""Time limit of a move beyond 1.5 times the duration of its profile [s]."""

_NOT_REACHED = "check brake, load, position_window, and that the drive's limits allow the move"
_ON_TARGET = (
    "the axis is on its target, but its drive does not show target reached (6041 bit 10): check "
    "its position window and time (6067, 6068)"
)
_STUCK = "check encoder, cable and the drive's update of its position (6064)"
_REMEDIES = {
    Phase.OFFERED: f"{_NOT_REACHED}, or state a longer acknowledge_timeout in the drives file",
    Phase.TAKEN: f"{_NOT_REACHED}; where the drive holds its acknowledge until the target is "
    "reached, state acknowledge: reached in the drives file",
}
_MISSING = SampleFlag.MISSING.value


@dataclass(slots=True)
class _Motion:
    command: SetPoint | HaltedAxis
    deadline: float
    duration: float
    start: float = 0.0
    under_way: bool = False
    still: tuple[float, float] = (math.nan, math.inf)
    alike: tuple[float, float] = (math.nan, math.inf)
    """Last position (`still`) and current, each with the time of its last change [s]."""
    following: Move | None = None


class ProfilePosition:
    """Set-points under way in profile position mode.

    Parameters
    ----------
    process_data : ProcessData
    axes : sequence of Axis
        Axes in joint order.
    period : float
        Time between two SYNCs [s].

    Attributes
    ----------
    active : dict
        Unfinished motions by axis.
    """

    def __init__(self, process_data: ProcessData, axes: Sequence[Axis], period: float) -> None:
        self.active: dict[int, _Motion] = {}
        self._process_data, self._axes, self._period = process_data, axes, period
        shortest = ACKNOWLEDGE_CYCLES * period
        self._patience = [max(axis.drive.acknowledge_timeout, shortest) for axis in axes]
        self._holds = [axis.drive.acknowledge == "reached" for axis in axes]
        self._profiles = [(0.0, 0.0)] * len(axes)

    def start(self, moves: Mapping[int, Move]) -> None:
        """Send checked set-points to axes."""
        for axis, move in moves.items():
            scale, server = self._axes[axis].scale, self._axes[axis].server
            velocity, acceleration = self._profiles[axis]
            if move.velocity != velocity:
                server.put(PROFILE_VELOCITY, scale.velocity_to_counts(move.velocity))
            if move.acceleration != acceleration:
                counts = scale.acceleration_to_counts(move.acceleration)
                server.put(PROFILE_ACCELERATION, counts)
                if PROFILE_DECELERATION not in server.missing:
                    server.put(PROFILE_DECELERATION, counts)
            self._profiles[axis] = (move.velocity, move.acceleration)
        for axis, move in moves.items():
            self._offer(axis, move)

    def halt(self) -> None:
        """Stop the axes with the deceleration of the last profile."""
        for axis, each in enumerate(self._axes):
            self._process_data.command(axis, self._position(axis), HALTED)
            duration = each.drive.limits.velocity / self.deceleration(axis)
            command = HaltedAxis(self._standstill(axis))
            self.active[axis] = _Motion(command, self._deadline(duration), duration)

    def velocity(self, axis: int) -> float:
        """Return the profile velocity of an axis's move [rad/s or m/s], 0 without one."""
        return self._profiles[axis][0] if axis in self.active else 0.0

    def deceleration(self, axis: int) -> float:
        """Return the deceleration of an axis's last profile [rad/s^2 or m/s^2]."""
        return self._profiles[axis][1] or self._axes[axis].drive.limits.acceleration

    def advance(self, time: float, process_data: ProcessData) -> MoveFailed | None:
        """Evaluate the SYNC at `time` [s]; return a failure if any.

        Axes with a missing TPDO wait for the next one.
        """
        for axis, motion in tuple(self.active.items()):
            if process_data.flags[axis] & _MISSING:
                continue
            position = process_data.positions[axis]
            if position != motion.still[0]:
                motion.still = position, time
            if process_data.currents[axis] != motion.alike[0]:
                motion.alike = process_data.currents[axis], time
            self._step(axis, motion, process_data.words[axis], position)
            if time > motion.deadline and axis in self.active:
                return self._describe_failure(axis, motion, position)
        return None

    def quiet_until(self, words: Sequence[int]) -> float:
        """Return the time until which only changes of statuswords matter [s]; -inf if none."""
        until = math.inf
        for axis, motion in self.active.items():
            command = motion.command
            if not isinstance(command, SetPoint) or not command.waits(words[axis]):
                return -math.inf
            until = min(until, motion.deadline)
        return until

    def pass_by(self, cycles: Cycles) -> None:
        """Evaluate SYNCs before `quiet_until`."""
        for axis, motion in self.active.items():
            rows = zip(cycles.times, cycles.positions, cycles.currents, strict=True)
            for time, positions, currents in rows:
                position = positions[axis]
                if currents[axis] != motion.alike[0]:
                    motion.alike = currents[axis], time
                if position != motion.still[0]:
                    motion.still = position, time
                # a waiting set-point tests one bit of the statusword, which is clear
                motion.command.step(0, position)

    def _offer(self, axis: int, move: Move) -> None:
        each, word = self._axes[axis], self._process_data.words[axis]
        target = each.scale.position_to_counts(move.target)
        distance = abs(target - self._position(axis)) * each.per_count
        duration = distance / move.velocity + 2 * move.velocity / move.acceleration
        command = SetPoint(target, each.band, self._standstill(axis))
        ends = self._process_data.now() + self._patience[axis]
        motion = _Motion(command, ends, duration, self._position(axis))
        earlier = self.active.get(axis)
        if self._holds[axis] and earlier is not None and isinstance(earlier.command, SetPoint):
            earlier.following = move
            return
        self.active[axis] = motion
        if earlier is not None and earlier.command.phase is Phase.OFFERED:
            # the drive must see bit 4 low before it can take another set-point
            self._process_data.command(axis, self._position(axis), ENABLED)
        else:
            self._step(axis, motion, word, self._position(axis))

    def _step(self, axis: int, motion: _Motion, word: int, position: int) -> None:
        command = motion.command
        phase = command.phase
        controlword = command.step(word, position)
        if self._holds[axis] and isinstance(command, SetPoint) and not motion.under_way:
            # the handshake may take the whole motion once motion has visibly begun
            moved = abs(position - motion.start) > command.window
            if (command.phase is Phase.OFFERED and moved) or command.phase is Phase.TAKEN:
                motion.under_way = True
                motion.deadline = self._deadline(motion.duration)
        if command.phase is phase:
            return
        if controlword is not None and isinstance(command, SetPoint):
            self._process_data.command(axis, command.target, controlword)
        if command.phase is Phase.TRAVELLING:
            motion.deadline = self._deadline(motion.duration)
        elif command.phase is Phase.REACHED:
            del self.active[axis]
            if motion.following is not None:
                self._offer(axis, motion.following)

    def _deadline(self, duration: float) -> float:
        return self._process_data.now() + 1.5 * duration + GRACE

    def _describe_failure(self, axis: int, motion: _Motion, position: int) -> MoveFailed:
        place, scale = self._axes[axis].label, self._axes[axis].scale
        q = scale.position_from_counts(position)
        if isinstance(motion.command, HaltedAxis):
            return MoveFailed(f"{place}: does not come to rest after halt, q = {q:g}; check load")
        target = scale.position_from_counts(motion.command.target)
        phase = motion.command.phase
        there = abs(position - motion.command.target) <= motion.command.window
        remedy = _ON_TARGET if there and phase is Phase.TRAVELLING else _NOT_REACHED
        still, seen = self._process_data.now() - motion.still[1], ""
        if still > GRACE and not there and phase is Phase.TRAVELLING:
            seen = f"the encoder has shown no motion for {still:.2g} s, "
            remedy = f"{_STUCK}, {_NOT_REACHED.removeprefix('check ')}"
        alike = self._process_data.now() - max(motion.still[1], motion.alike[1])
        if alike > min(GRACE, self._patience[axis]) / 2:
            seen = f"position and current have not changed for {alike:.2g} s: if its current "
            seen += "usually varies, the drive's program hangs: switch the drive off and on; "
        remote = [bool(word & Status.REMOTE) for word in self._process_data.words]
        if phase is Phase.OFFERED and any(remote) and not remote[axis]:
            seen = "accepts no commands over the bus (statusword bit 9, remote, is clear): "
            seen += "release it from local control or the maker's tool; "
        return MoveFailed(
            f"{place}: {seen}set-point {target:g} at q = {q:g}: {phase.value}, for too long; "
            f"{_REMEDIES.get(phase, remedy)}"
        )

    def _position(self, axis: int) -> int:
        return self._process_data.positions[axis]

    def _standstill(self, axis: int) -> Standstill:
        return standstill_of(self._axes[axis], self._period)
