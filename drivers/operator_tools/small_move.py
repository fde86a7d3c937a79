"""One axis moved a little, watched at every SYNC, and what was seen of it.

A drive whose velocity unit is another than the file's may run a hundred times too fast. So an axis
that is twice as fast as commanded is given up at once, which stops it; that it stays between start
and target is what the driver sees to (`drivers.safety.trips`). Beside position and torque at every
SYNC the drive's own following error (60F4) is read now and then by SDO.
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
"""Speed is taken from positions this far apart [s]: a drive may not renew them with each SYNC."""
TOO_FAST = 2.0
"""Times the commanded velocity at which a move is given up."""
POLLED = 0.1
"""Time between two readings of the following error [s]."""
TOO_SLOW = 1.4
"""Times its duration after which a move is given up."""
RAMP = 0.25
"""Time that a small move takes to speed up [s]."""


@dataclass(frozen=True, slots=True)
class Stroke:
    """One small move as it was seen.

    Attributes
    ----------
    move : Move
        What was commanded.
    time, q, tau : ndarray, shape (n,)
        Of each SYNC [s], [rad], [N m]; NaN where the TPDO is missing.
    following_error : float
        The largest that the drive showed [rad]; NaN where it does not show one.
    """

    move: Move
    time: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    following_error: float

    @property
    def peak_torque(self) -> float:
        """The largest torque either way [N m]."""
        return float(np.nanmax(np.abs(self.tau)))

    @property
    def cruising(self) -> NDArray[np.bool_]:
        """Which samples lie in the middle part of the way, at constant velocity; shape (n,)."""
        way = self.move.velocity**2 / self.move.acceleration / 2
        return self.between(min(1.2 * way, 0.4 * abs(self.move.target - float(self.q[0]))))

    def between(self, margin: float) -> NDArray[np.bool_]:
        """Return which samples lie farther than `margin` from both ends [rad]; shape (n,)."""
        low, high = sorted((float(self.q[0]), self.move.target))
        inside: NDArray[np.bool_] = (self.q > low + margin) & (self.q < high - margin)
        return inside


def small_move(axis: AxisDrive, target: float, velocity: float) -> Move:
    """Return a slow move: with the ramps of `RAMP`, within what limits and the drive's units allow.

    Parameters
    ----------
    axis : AxisDrive
        Whose limits hold.
    target, velocity : float
        [rad], [rad/s].
    """
    scale, limits = AxisScale.derive(axis), axis.limits
    velocity = min(max(velocity, scale.velocity), limits.velocity)
    acceleration = min(max(velocity / RAMP, scale.acceleration), limits.acceleration)
    return Move(target, velocity, acceleration)


def travel(
    bus: ServoAxes,
    number: int,
    drive: AxisDrive,
    move: Move,
    operator: Operator,
    poll: Callable[[float], None] = lambda _time: None,
) -> Stroke:
    """Move one axis under supervision and return what was seen.

    Parameters
    ----------
    bus : ServoAxes
        Entered.
    number : int
        The axis on `bus`, from 0.
    drive : AxisDrive
        What the drives file states of it.
    move : Move
        What to do.
    operator : Operator
        Who may stop it.
    poll : callable
        Called on the way, with the time [s].

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
    """Gives up a move that is faster than commanded, or far slower."""

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
        """Take a position [rad], NaN where it is missing, since the start [s]."""
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
    """Reads object 60F4 every now and then."""

    def __init__(self, server: RemoteDictionary, drive: AxisDrive) -> None:
        self.largest = math.nan
        self._server = server
        self._per_count = abs(AxisScale.derive(drive).position)
        self._next = -math.inf

    def poll(self, time: float) -> None:
        """Read it if it is time; a drive that lacks it is not asked again."""
        if time < self._next:
            return
        counts = self._server.find(objects.FOLLOWING_ERROR)
        self._next = math.inf if counts is None else time + POLLED
        if counts is not None:
            self.largest = max(abs(counts) * self._per_count, np.nan_to_num(self.largest))
