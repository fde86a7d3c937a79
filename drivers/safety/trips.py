"""Supervision of all axes by the samples, independent of the drives.

Three criteria are checked, in the drives' counts to save time:

corridor
    the position is between start and target, within the following error window; at rest, at the
    last target. The corridor replaces the following error (60F4), which does not fit into the TPDO
    and is supervised by each drive (6065). It needs no model of the drive's profile, and it guards
    the planned path.
speed
    the speed at the encoder is at most `drives_file.Trip.velocity`, also during encoder jumps.
torque
    none above `drives_file.Trip.torque` lasts longer than `drives_file.Trip.torque_time`.

Corridor and speed are checked at alternate SYNCs, torque at every eighth: the first two trip at
the second SYNC of a violation, at the latest. If several SYNCs pass in one call, on a virtual plant
only, all are checked after the last.

Missing and doubled process data are counted: one is a gap, ten are a loss of control. In lock-step
nothing arrives unless something is sent. Hence our heartbeat is sent early after a gap
(`collect_late`): a late TPDO arrives with it, is flagged as late and dropped, and is not mistaken
for the answer to the next SYNC.
"""

from __future__ import annotations

import math
from itertools import chain
from operator import gt, lt, sub
from typing import TYPE_CHECKING

from drivers.drive_bus import NodeSilent, SampleFlag, Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import Cycles, ProcessData
    from drivers.drive_bus import DriveError
    from drivers.drives_file import AxisDrive

BLIND = 10
"""Consecutive SYNCs without an axis's TPDO until all axes are stopped."""
BUSY = 0.25
"""Minimum time without TPDOs until a stop while this computer is late [s]: late delivery is
likely."""


class MissingTelegrams:
    """Counter of unanswered SYNCs, for each axis.

    Parameters
    ----------
    axes : sequence of Axis
        Axes in joint order.
    collect_late : callable
        Receives late telegrams; called after a gap.
    period : float
        Time between two SYNCs [s].
    silence, wiring : str
        Parts of the message: missing telegrams, and checks of the bus.
    doubling : str
        See `drivers.session.connection.Connection`.

    Attributes
    ----------
    open : bool
        True if the last sample had a gap.
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        collect_late: Callable[[], None],
        period: float,
        silence: str,
        wiring: str,
        doubling: str,
    ) -> None:
        self._silence, self._wiring, self._doubling = silence, wiring, doubling
        self._busy = max(BLIND, math.ceil(BUSY / period))
        self.open = False
        self._axes, self._collect_late = axes, collect_late
        self._counts = [0] * len(axes)
        self._doubled = [0] * len(axes)

    @property
    def blind(self) -> bool:
        """True if an axis has been unobserved for more than one SYNC."""
        return self.open and max(self._counts) > 1

    def look(
        self, flags: Sequence[int], misfits: Mapping[int, str], *, busy: bool = False
    ) -> DriveError | None:
        """Check the flags of a sample; return an error if an axis is unobserved for too long.

        Parameters
        ----------
        misfits : mapping of int to str
            Description of the telegram that arrived instead of the expected one, by axis.
        busy : bool
            True if this computer was late just now.
        """
        most = self._busy if busy else BLIND
        for axis in self._axes:
            gone = flags[axis.index] & SampleFlag.MISSING
            self._counts[axis.index] = self._counts[axis.index] + 1 if gone else 0
            twice = flags[axis.index] & SampleFlag.DOUBLED
            self._doubled[axis.index] = self._doubled[axis.index] + 1 if twice else 0
        self.open = any(self._counts)
        if self.open:
            self._collect_late()
        if max(self._doubled) >= BLIND:
            labels = ", ".join(a.label for a in self._axes if self._doubled[a.index] >= BLIND)
            return Tripped(f"{labels}: {self._doubling.format(BLIND)}")
        blind = [axis.label for axis in self._axes if self._counts[axis.index] >= most]
        if not blind:
            return None
        found = [misfits[axis.index] for axis in self._axes if axis.index in misfits]
        why = f"; {'; '.join(found)}" if found else ""
        return NodeSilent(
            f"{', '.join(blind)}: {self._silence.format(most)}{why}; check the drive's supply, "
            f"{self._wiring}"
        )


TORQUE_SHARE = 0.95
"""Default torque threshold, as a share of the torque limit."""

SPEED_SHARE = 1.3
"""Default speed threshold, as a multiple of the speed limit."""

JITTER = 0.5
"""Jitter of SYNC between sending and arrival at the drives, as a share of the period."""

WRAPS = 0.03
"""Largest relative deviation of a counter's wrap-around from a power of two, motion included."""

_TURNS = 8


class Trips:
    """Check of the process data of each SYNC for reasons to stop the axes.

    Parameters
    ----------
    axes : sequence of Axis
        Axes in joint order.
    period : float
        Time between two SYNCs [s].
    """

    def __init__(self, axes: Sequence[Axis], period: float) -> None:
        self._axes, self._period = axes, period
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
        """Start the supervision: all axes rest at `positions` [increments]."""
        self._lows = [positions[axis.index] - axis.window for axis in self._axes]
        self._highs = [positions[axis.index] + axis.window for axis in self._axes]
        self._last, self._last_time = tuple(positions), time
        self._since.clear()

    def expect(self, axis: int, position: int, target: float, *, moving: bool) -> None:
        """Allow an axis to go from `position` to `target` [rad or m].

        An axis still `moving` may overshoot before it turns to the new target, so it keeps its
        previous corridor as well.
        """
        counts, window = self._axes[axis].scale.position_to_counts(target), self._axes[axis].window
        low, high = min(position, counts) - window, max(position, counts) + window
        self._lows[axis] = min(low, self._lows[axis]) if moving else low
        self._highs[axis] = max(high, self._highs[axis]) if moving else high

    def follow(self, lows: Iterable[int], highs: Iterable[int]) -> None:
        """Set the corridors of all axes to `lows` to `highs` [increments] until the next call."""
        self._lows, self._highs = list(lows), list(highs)

    def look_ahead(self, cycles: Cycles) -> Tripped | None:
        """Check several regular SYNCs as `look` does; return the first reason to stop."""
        times, positions, currents = cycles
        columns, n = list(zip(*positions, strict=True)), len(times)
        before, flat = [self._last, *positions], chain.from_iterable
        if (
            True in map(lt, map(min, columns), self._lows)
            or True in map(gt, map(max, columns), self._highs)
            # two successive steps of at most half the bound stay within the bound
            or True
            in map(gt, map(abs, map(sub, flat(positions), flat(before))), self._half_steps * n)
            or True in map(gt, map(abs, flat(currents)), self._currents * n)
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
        """Return the reason to stop the axes now, None if there is none.

        Parameters
        ----------
        time : float
            Instant of the SYNC [s].
        process_data : ProcessData
        """
        return self._look(
            time, process_data.positions, process_data.currents, irregular=process_data.irregular
        )

    def _look(
        self, time: float, positions: tuple[int, ...], currents: Sequence[float], *, irregular: bool
    ) -> Tripped | None:
        self._turn = turn = (self._turn + 1) % _TURNS
        if turn & 1:
            if irregular:  # the next check has a longer time base
                return None
            last, then = self._last, self._last_time
            self._last, self._last_time = positions, time
            if True in map(gt, map(abs, map(sub, positions, last)), self._steps):
                return self._judge_speed(time - then, positions, last)
            return None
        if True in map(gt, positions, self._highs) or True in map(lt, positions, self._lows):
            jump = self._judge_speed(time - self._last_time, positions, self._last)
            return jump or self._describe_corridor(positions)
        return None if turn else self._judge_torque(time, currents)

    def _describe_corridor(self, positions: Sequence[int]) -> Tripped:
        bounds = zip(positions, self._lows, self._highs, strict=True)
        n = next(i for i, (p, low, high) in enumerate(bounds) if not low <= p <= high)
        axis, unit = self._axes[n], self._axes[n].drive.unit
        to_joint = axis.scale.position_from_counts
        ends = sorted((to_joint(self._lows[n]), to_joint(self._highs[n])))
        return Tripped(
            f"{axis.label}: at {to_joint(positions[n]):.4g} {unit}, outside {ends[0]:.4g} ... "
            f"{ends[1]:.4g} {unit} around the set-point (following error window "
            f"{axis.drive.following_error_window:g} {unit}); check sign, gear ratio, brake, "
            "encoder and load"
        )

    def _judge_speed(
        self, elapsed: float, positions: Sequence[int], last: Sequence[int]
    ) -> Tripped | None:
        for axis, velocity in zip(self._axes, self._velocities, strict=True):
            step = abs(positions[axis.index] - last[axis.index])
            if step > velocity * (elapsed + JITTER * self._period):
                per_count, unit = axis.per_count, axis.drive.unit
                return Tripped(
                    f"{axis.label}: {step * per_count:.4g} {unit} in {elapsed:.3g} s is "
                    f"{step * per_count / elapsed:.4g} {unit}/s, at most "
                    f"{velocity * per_count:.4g} {unit}/s allowed (trip.velocity); the axis runs "
                    f"away or {_suspect_cause(step, axis)}: check encoder cable and tuning"
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
                    f"{axis.label}: {abs(current) * per_count:.4g} {unit} for {lasted:.3g} s, at "
                    f"most {axis.drive.trip.torque_time:g} s above {bound * per_count:.4g} "
                    f"{unit} allowed (trip.torque); the axis is blocked or overloaded: check "
                    "brake, load and obstacles"
                )
        return None


def _suspect_cause(step: int, axis: Axis) -> str:
    """Return the cause, other than motion, of a step in position [increments], in words."""
    limits = axis.drive.limits
    if step * axis.per_count > limits.q_max - limits.q_min:
        return "another master changed the mapping of its process data"
    turn = 1 << round(math.log2(step))
    wraps = f", or wraps around at {turn} counts (607B)" if abs(step / turn - 1) < WRAPS else ""
    return f"its encoder jumps{wraps}"


def fastest(axis: AxisDrive) -> float:
    """Return the speed at which the driver stops an axis [rad/s or m/s]."""
    return axis.trip.velocity or SPEED_SHARE * axis.limits.velocity
