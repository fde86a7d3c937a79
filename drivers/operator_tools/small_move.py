"""Small supervised move of an axis, and its observation.

A drive with another velocity unit than the file's may run a hundred times too fast. Hence an axis
twice as fast as commanded is given up at once, which stops it; the corridor between start and
target is supervised by the driver (`drivers.safety.trips`). Besides position and torque at every
SYNC, the drive's own following error (60F4) is read at intervals by SDO.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.drive_bus import Move, MoveFailed
from drivers.operator_tools.operator import supervised_sample

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from drivers.drives_file import AxisDrive
    from drivers.operator_tools.operator import Operator
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.servo_axes import ServoAxes

SPEED_TIME = 0.08
"""Time base of the speed [s]: a drive may not refresh positions with each SYNC."""
TOO_FAST = 2.0
"""Speed at which a move is given up, as a multiple of the commanded speed."""
POLLED = 0.1
"""Time between two readings of the following error [s]."""
TOO_SLOW = 1.4
"""Duration after which a move is given up, as a multiple of the planned duration."""
RAMP = 0.25
"""Acceleration time of a small move [s]."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """Observation of a small move.

    Attributes
    ----------
    move : Move
        Commanded move.
    time, q, tau : ndarray, shape (n,)
        Instants [s], positions [rad], torques [N m] of the SYNCs; NaN where the TPDO is missing.
    following_error : float
        Largest following error [rad]; NaN if the drive does not show it.
    """

    move: Move
    time: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    following_error: float

    @property
    def peak_torque(self) -> float:
        """Largest magnitude of torque [N m]."""
        return float(np.nanmax(np.abs(self.tau)))

    @property
    def cruising(self) -> NDArray[np.bool_]:
        """Mask of the samples in the middle of the path, at constant velocity; shape (n,)."""
        way = self.move.velocity**2 / self.move.acceleration / 2
        return self.between(min(1.2 * way, 0.4 * abs(self.move.target - float(self.q[0]))))

    def between(self, margin: float) -> NDArray[np.bool_]:
        """Return a mask of the samples farther than `margin` from both ends [rad]; shape (n,)."""
        low, high = sorted((float(self.q[0]), self.move.target))
        inside: NDArray[np.bool_] = (self.q > low + margin) & (self.q < high - margin)
        return inside


def small_move(axis: AxisDrive, target: float, velocity: float) -> Move:
    """Return a slow move with ramps of `RAMP`, within limits and resolution of the drive.

    Parameters
    ----------
    axis : AxisDrive
        Axis with the limits.
    target, velocity : float
        Target [rad], velocity [rad/s].
    """
    scale, limits = AxisScale.derive(axis), axis.limits
    velocity = min(max(velocity, scale.velocity), limits.velocity)
    acceleration = min(max(velocity / RAMP, scale.acceleration), limits.acceleration)
    return Move(target, velocity, acceleration)


def format_coordinate(axis: AxisDrive, value: float, spec: str = ".4g") -> str:
    """Format a joint coordinate or distance [rad or m] in degrees or mm."""
    if axis.joint == "prismatic":
        return f"{1000 * value + 0.0:{spec}} mm"
    return f"{math.degrees(value) + 0.0:{spec}}°"


def travel(
    bus: ServoAxes,
    number: int,
    drive: AxisDrive,
    move: Move,
    operator: Operator,
    poll: Callable[[float], None] = lambda _time: None,
) -> Stroke:
    """Move an axis under supervision and return the observed stroke.

    Parameters
    ----------
    bus : ServoAxes
        Entered bus.
    number : int
        Index of the axis on `bus`, from 0.
    drive : AxisDrive
    move : Move
        Move to command.
    operator : Operator
        Can stop the motion.
    poll : callable
        Called during the motion, with the time [s].

    Raises
    ------
    MoveFailed
        The axis is too fast; leaving `bus` stops it.
    StoppedByOperator, DriveError
        As `supervised_sample`.
    """
    server = bus.servers[number]
    begin = supervised_sample(bus, operator)
    watch = _Watch(server.label, drive, begin.q[number], move, bus.period)
    rows = [(begin.time, begin.q[number], begin.tau[number])]
    following = _FollowingError(server, drive)
    bus.move({number: move})
    while True:
        sample = supervised_sample(bus, operator)
        rows.append((sample.time, sample.q[number], sample.tau[number]))
        if sample.reached:
            break
        watch.look(sample.time - begin.time, sample.q[number])
        following.poll(sample.time)
        poll(sample.time)
    time, q, tau = np.array(rows).T
    return Stroke(move, time, q, tau, following.largest)


class _Watch:
    """Supervision of a move's speed: gives up a move much faster or slower than commanded."""

    def __init__(
        self, label: str, drive: AxisDrive, start: float, move: Move, period: float
    ) -> None:
        self._label = label
        self._span = max(1, round(SPEED_TIME / period))
        self._unit = f"{drive.unit}/s"
        self._step = 2 * abs(AxisScale.derive(drive).position)
        self._commanded = move.velocity
        self._seen = [(0.0, start)]
        duration = abs(move.target - start) / move.velocity + move.velocity / move.acceleration
        self._patience = TOO_SLOW * duration + 1.0

    def look(self, time: float, q: float) -> None:
        """Check a position [rad], NaN if missing, at a time since the start [s]."""
        self._seen.append((time, self._seen[-1][1] if math.isnan(q) else q))
        before, there = self._seen[max(0, len(self._seen) - 1 - self._span)]
        way, elapsed = abs(self._seen[-1][1] - there), time - before
        if way > TOO_FAST * self._commanded * elapsed + self._step:
            self._give_up(f"{way / max(elapsed, 1e-9):.3g} {self._unit}")
        if time > self._patience:
            mean = abs(self._seen[-1][1] - self._seen[0][1]) / time
            self._give_up(f"{mean:.3g} {self._unit} on average in {time:.2g} s")

    def _give_up(self, found: str) -> NoReturn:
        raise MoveFailed(
            f"{self._label}: {found}, {self._commanded:.3g} {self._unit} was commanded; check "
            "velocity_unit, acceleration_unit and gear_ratio, brake and load"
        )


class _FollowingError:
    """Reader of object 60F4 at intervals."""

    def __init__(self, server: RemoteDictionary, drive: AxisDrive) -> None:
        self.largest = math.nan
        self._server = server
        self._per_count = abs(AxisScale.derive(drive).position)
        self._next = -math.inf

    def poll(self, time: float) -> None:
        """Read the object when due; a drive without it is not asked again."""
        if time < self._next:
            return
        counts = self._server.find(objects.FOLLOWING_ERROR)
        self._next = math.inf if counts is None else time + POLLED
        if counts is not None:
            self.largest = max(abs(counts) * self._per_count, np.nan_to_num(self.largest))
