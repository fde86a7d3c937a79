"""Stopping all axes for what the samples show, whatever the drives think of it.

Three things are looked for, all in the drives' own counts so that a look costs next to nothing:

corridor
    an axis lies between where it stood and where it was sent, give or take the following error
    window; at rest, where it was sent last. This stands in for the following error (60F4), which
    the TPDO has no room for and each drive watches for itself (6065): it needs no model of the
    drive's profile, and it guards what was planned, for no axis leaves the ways that were checked.
speed
    the encoder shows no more than `drives_file.Trip.velocity`. A jump of the encoder is speed too.
torque
    none beyond `drives_file.Trip.torque` lasts longer than `drives_file.Trip.torque_time`.

Corridor and speed take turns, torque is looked at at every eighth SYNC. So the first two trip at
the latest with the second SYNC that shows it. Where several SYNCs pass in one call, which only a
virtual plant offers, all of them are looked at after the last.
"""

from __future__ import annotations

import math
from operator import gt, lt, sub
from typing import TYPE_CHECKING

from drivers.drive_bus import Tripped

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import Cycles, ProcessData
    from drivers.drives_file import AxisDrive

TORQUE_SHARE = 0.95
"""Share of its torque limit that an axis may not need for long, unless stated."""

SPEED_SHARE = 1.3
"""Multiple of its speed limit that an axis may not reach, unless stated."""

JITTER = 0.5
"""Share of the period by which a SYNC may reach the drives at another instant than it was sent."""

WRAPS = 0.03
"""Share by which a jump may differ from a power of two to be that of a counter, and some motion."""

_TURNS = 8


class Trips:
    """Looks at the process data of each SYNC and finds why the axes must stop, if they must.

    Parameters
    ----------
    axes : sequence of Axis
        In joint order.
    period : float
        Time between two SYNCs [s].
    """

    def __init__(self, axes: Sequence[Axis], period: float) -> None:
        self._axes = axes
        self._period = period
        self._velocities = [fastest(axis.drive) / axis.per_count for axis in axes]
        self._steps = [2 * velocity * period for velocity in self._velocities]
        self._half_steps = [step / 2 for step in self._steps]
        self._currents = [
            (axis.drive.trip.torque or TORQUE_SHARE * axis.drive.limits.torque)
            / abs(axis.scale.torque)
            for axis in axes
        ]
        self._since: dict[int, float] = {}
        self._turn = 0

    def arm(self, time: float, positions: Sequence[int]) -> None:
        """Begin to look: all axes rest at `positions` [increments]."""
        self._lows = [positions[axis.index] - axis.window for axis in self._axes]
        self._highs = [positions[axis.index] + axis.window for axis in self._axes]
        self._last, self._last_time = tuple(positions), time
        self._since.clear()

    def expect(self, axis: int, position: int, target: float, *, moving: bool) -> None:
        """Let an axis go from `position` to `target` [rad or m].

        An axis that is still `moving` may overrun on its way to another target, so it keeps the
        corridor that it has as well.
        """
        counts, window = self._axes[axis].scale.position_to_counts(target), self._axes[axis].window
        low, high = min(position, counts) - window, max(position, counts) + window
        self._lows[axis] = min(low, self._lows[axis]) if moving else low
        self._highs[axis] = max(high, self._highs[axis]) if moving else high

    def follow(self, lows: Iterable[int], highs: Iterable[int]) -> None:
        """Let all axes be between `lows` and `highs` [increments] until others are given."""
        self._lows, self._highs = list(lows), list(highs)

    def look_ahead(self, cycles: Cycles) -> Tripped | None:
        """Do as `look` for each of several regular SYNCs; return the first reason to stop."""
        times, positions, currents = cycles
        columns = list(zip(*positions, strict=True))
        before = [self._last, *positions]
        if (
            True in map(lt, map(min, columns), self._lows)
            or True in map(gt, map(max, columns), self._highs)
            # two steps in a row of at most half the bound keep it
            or any(
                True in map(gt, map(abs, map(sub, here, there)), self._half_steps)
                for here, there in zip(positions, before, strict=False)
            )
            or any(True in map(gt, map(abs, here), self._currents) for here in currents)
            or self._since
        ):
            found = (
                self._look(*values, irregular=False)
                for values in zip(times, positions, currents, strict=True)
            )
            return next(filter(None, found), None)
        turn, self._turn = self._turn, (self._turn + len(times)) % _TURNS
        odd = len(times) - 1 if self._turn & 1 else len(times) - 2
        if odd >= 0 and (turn + odd + 1) & 1:
            self._last, self._last_time = positions[odd], times[odd]
        return None

    def look(self, time: float, process_data: ProcessData) -> Tripped | None:
        """Return why the axes must stop now, None if they need not.

        Parameters
        ----------
        time : float
            The SYNC's instant [s].
        process_data : ProcessData
            What it brought.
        """
        return self._look(
            time, process_data.positions, process_data.currents, irregular=process_data.irregular
        )

    def _look(
        self,
        time: float,
        positions: tuple[int, ...],
        currents: Sequence[float],
        *,
        irregular: bool,
    ) -> Tripped | None:
        self._turn = turn = (self._turn + 1) % _TURNS
        if turn & 1:
            if irregular:  # the SYNC before must do, with a longer time in between
                return None
            last, then = self._last, self._last_time
            self._last, self._last_time = positions, time
            if True in map(gt, map(abs, map(sub, positions, last)), self._steps):
                return self._judge_speed(time - then, positions, last)
            return None
        if True in map(gt, positions, self._highs) or True in map(lt, positions, self._lows):
            jump = self._judge_speed(time - self._last_time, positions, self._last)
            return jump or self._outside(positions)
        return None if turn else self._judge_torque(time, currents)

    def _outside(self, positions: Sequence[int]) -> Tripped:
        bounds = zip(positions, self._lows, self._highs, strict=True)
        n = next(i for i, (p, low, high) in enumerate(bounds) if not low <= p <= high)
        axis, unit = self._axes[n], self._axes[n].drive.unit
        to_joint = axis.scale.position_from_counts
        ends = sorted((to_joint(self._lows[n]), to_joint(self._highs[n])))
        return Tripped(
            f"{axis.label}: at {to_joint(positions[n]):.4g} {unit}, outside"
            f" {ends[0]:.4g} ... {ends[1]:.4g} {unit}, where its set-point leads (following error"
            f" window {axis.drive.following_error_window:g} {unit}); check sign, gear ratio,"
            " brake, encoder and load"
        )

    def _judge_speed(
        self, elapsed: float, positions: Sequence[int], last: Sequence[int]
    ) -> Tripped | None:
        for axis, velocity in zip(self._axes, self._velocities, strict=True):
            way = abs(positions[axis.index] - last[axis.index])
            if way > velocity * (elapsed + JITTER * self._period):
                per_count, unit = axis.per_count, axis.drive.unit
                return Tripped(
                    f"{axis.label}: {way * per_count:.4g} {unit} in {elapsed:.3g} s is"
                    f" {way * per_count / elapsed:.4g} {unit}/s, at most"
                    f" {velocity * per_count:.4g} {unit}/s may be (trip.velocity); the axis runs"
                    f" away or {_cause(way, axis)}: check encoder cable and tuning"
                )
        return None

    def _judge_torque(self, time: float, currents: Sequence[float]) -> Tripped | None:
        for axis, current, bound in zip(self._axes, currents, self._currents, strict=True):
            if abs(current) <= bound:
                self._since.pop(axis.index, None)
                continue
            lasted = time - self._since.setdefault(axis.index, time)
            if lasted > axis.drive.trip.torque_time:
                per_count, unit = abs(axis.scale.torque), axis.drive.effort_unit
                return Tripped(
                    f"{axis.label}: {abs(current) * per_count:.4g} {unit} for"
                    f" {lasted:.3g} s, more than {bound * per_count:.4g} {unit} may not last longer"
                    f" than {axis.drive.trip.torque_time:g} s (trip.torque); the axis is"
                    " blocked or overloaded: check brake, load and obstacles"
                )
        return None


def _cause(way: int, axis: Axis) -> str:
    """Return in words what else than motion may show such a way [increments]."""
    limits = axis.drive.limits
    if way * axis.per_count > limits.q_max - limits.q_min:
        return "somebody else mapped its process data anew, which carry no position any more"
    turn = 1 << round(math.log2(way))
    wraps = f", or wraps around at {turn} counts (607B)" if abs(way / turn - 1) < WRAPS else ""
    return f"its encoder jumps{wraps}"


def fastest(axis: AxisDrive) -> float:
    """Return the speed that an axis may not reach [rad/s or m/s]."""
    return axis.trip.velocity or SPEED_SHARE * axis.limits.velocity
