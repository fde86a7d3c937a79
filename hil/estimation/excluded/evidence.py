"""Thinned samples of recordings: the rows for the tests of causes.

A channel is the torque of an axis in recordings of one kind; a row is a sample of a channel, with
the torque, the columns of the base parameters and of the channel, and the motion, all smoothed
alike.
Friction of a part (a measurement, a period) is projected out within the part, so that no cause is
tested by an effect of friction. Parts are cut into groups for the covariance. The error of a
friction law in a trajectory repeats in each period, so periods share their groups.

Some thousand rows of each axis are enough: more samples of each recording do not reduce the scatter
between recordings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from hil.estimation.condensed import groups, stack_axis, thinned
from hil.friction.equation import FEWEST, LOAD, limit_or_reached
from hil.friction.terms import coupled_friction
from hil.least_squares.blocks import Blocks
from hil.least_squares.solving import orthonormal
from hil.least_squares.window import smooth_at, weights
from hil.model.base_parameters import base_parameters
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

MOST = 2400
"""Approximate number of rows of a channel: twice as many take twice the time, and detectable sizes
are 5 % smaller.
"""
LONGEST = 10.0
"""Maximum duration of a group [s]: the error of a friction law in a period of a trajectory differs
from one part of it to the next."""
FEWEST_GROUPS = 12
"""Minimum number of groups, if parts are long enough: a test with fewer groups has no power."""
FINEST = 1e-4
"""Share of the torque limit below which no model is exact: differences of positions and means over
the window leave an error of this size even in torques without noise."""
SAME = 1e-6
"""Threshold on singular values, since friction columns are equal at a single speed."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Rows of all channels: thinned samples with torques, columns and motion.

    Attributes
    ----------
    axis, group : ndarray of int, shape (n,)
        Axis and group of each row, from 0; rows of an axis are contiguous. A group is left out or
        clustered as a whole.
    torque : ndarray, shape (n,)
        Torque without that of rotors of known inertia [N m].
    recorded : ndarray, shape (n,)
        Torque including rotors of known inertia [N m].
    rate : ndarray, shape (n,)
        Time derivative of `recorded` [N m/s]; zero if changes are not tested.
    X : ndarray, shape (n, n_base)
    own : ndarray, shape (n, n_own)
        Columns of the channel alone.
    motion : ndarray, shape (3, 3, n, n_joints)
        q, qd and qdd, one sample before the row, at the row and one after it; constant for axes at
        rest.
    period : ndarray, shape (n,)
        Time between the samples of `motion` [s].
    time : ndarray, shape (n,)
        Time since the first row [s].
    parts : tuple of (slice, ndarray)
        Rows with common friction, and an orthonormal basis of this friction.
    finest : ndarray, shape (n_channels,)
        Torque below which no model is exact [N m].
    signals : sequence of Signals
        Recordings of the rows.
    source, sample : ndarray of int, shape (n,)
        Index into `signals`, and index of the sample.
    later : ndarray of bool, shape (n,), optional
        Rows of recordings tested for causes, if the other rows are free of causes.
    imported : bool
        True for recordings with a rate stated by the owner.
    """

    axis: Indices
    group: Indices
    torque: Array
    recorded: Array
    rate: Array
    X: Array
    own: Array
    motion: Array
    period: Array
    time: Array
    parts: tuple[tuple[slice, Array], ...]
    finest: Array
    signals: Sequence[Signals]
    source: Indices
    sample: Indices
    later: Mask | None = None
    imported: bool = False

    def project_out_friction(self, x: Array) -> Array:
        """Project friction out of the rows of `x`, shape (n, ...), part by part."""
        found = x.copy()
        for rows, Q in self.parts:
            found[rows] -= Q @ (Q.T @ x[rows])
        return found

    def project_out_own(self) -> Evidence:
        """Project out channels' own columns like friction, and count them like friction.

        Later rows have a basis of their own: if their torque has another sign, so has its offset.
        """
        own, parts = self.project_out_friction(self.own), list(self.parts)
        for channel in range(self.n_channels):
            for run in (False, True):
                rows = np.flatnonzero((self.axis == channel) & (self.is_later == run))
                if len(rows) and own.shape[1]:
                    basis, _ = orthonormal(own[rows], SAME)
                    parts.append((slice(rows[0], rows[-1] + 1), basis))
        return replace(self, own=own[:, :0], parts=tuple(parts))

    @property
    def channels(self) -> list[tuple[int, slice]]:
        """Axes with rows, from 0, and their rows."""
        begins = np.flatnonzero(np.diff(self.axis, prepend=-1)).tolist()
        ends = [*begins[1:], len(self.axis)]
        return [(int(self.axis[a]), slice(a, b)) for a, b in zip(begins, ends, strict=True)]

    @property
    def overlap(self) -> float:
        """Dispersion of white noise: rows closer than the window's width share samples."""
        found = np.ones(len(self.axis))
        for rows, _ in self.parts:
            apart = np.diff(self.sample[rows])
            step = int(np.median(apart)) if len(apart) else 1
            window = weights(float(self.period[rows.start]))
            shared = np.correlate(window, window, "full")[len(window) - 1 :: step]
            found[rows] = 2.0 * shared.sum() / shared[0] - 1.0
        return float(found.mean())

    def blocks(self, rows: Array, n_shared: int, axis: Indices | None = None) -> Blocks:
        """Add up the rows of a torque, of shared columns, and of channels' own columns.

        Parameters
        ----------
        rows : ndarray, shape (n, 1 + n_shared + n_own)
            Rows without friction.
        axis : ndarray of int, shape (n,), optional
            Axes of the rows, if in another order.
        """
        if axis is None:
            runs = dict(self.channels)
            channels = [rows[runs.get(each, slice(0))] for each in range(self.n_channels)]
        else:
            channels = [rows[axis == each] for each in range(self.n_channels)]
        counts = np.array([float(len(own)) for own in channels])
        for at, Q in self.parts:
            counts[self.axis[at.start]] -= Q.shape[1]
        return Blocks(
            tuple(f"shared {k}" for k in range(n_shared)),
            tuple(f"own {k}" for k in range(rows.shape[1] - 1 - n_shared)),
            np.array([[own.T @ own for own in channels]]),
            counts[np.newaxis],
        )

    @property
    def is_later(self) -> Mask:
        """Rows tested for causes, if earlier rows are without causes; otherwise none."""
        return np.zeros(len(self.axis), dtype=bool) if self.later is None else self.later

    @property
    def least(self) -> Array:
        """Mean squares below which no model is exact, shape (n_channels,) [(N m)^2]."""
        return np.maximum(self.finest**2, np.finfo(float).tiny)

    @property
    def n_channels(self) -> int:
        """Number of channels, including channels without rows."""
        return int(self.motion.shape[-1])

    def thinned(self, most: int) -> tuple[Evidence, Indices]:
        """Return at least `most` rows of a channel, plus one per friction term, with row indices.

        Without the additional rows, the friction terms of many parts could fit all rows exactly.
        """
        counts, kept = np.bincount(self.axis), []
        for rows, Q in self.parts:
            n = rows.stop - rows.start
            wanted = Q.shape[1] + most * n / counts[self.axis[rows.start]]
            kept.append(np.arange(rows.start, rows.stop)[:: max(1, int(n / wanted))])
        return self._select(kept), np.concatenate(kept)

    def only(self, chosen: Mask) -> Evidence:
        """Return the parts with a chosen first row; own columns must not be projected out yet."""
        return self._select([
            np.arange(rows.start, rows.stop) if chosen[rows.start] else [] for rows, _ in self.parts
        ])  # fmt: skip

    def _select(self, kept: Sequence[Indices | Sequence[int]]) -> Evidence:
        """Return some rows of each part."""
        parts, first = [], 0
        for (rows, Q), some in zip(self.parts, kept, strict=True):
            if len(some):
                basis, _ = orthonormal(Q[np.asarray(some) - rows.start], SAME)
                parts.append((slice(first, first + len(some)), basis))
                first += len(some)
        at = np.concatenate(kept).astype(np.intp)
        return replace(
            self,
            **{name: getattr(self, name)[at] for name in COLUMNS},
            motion=self.motion[:, :, at],
            parts=tuple(parts),
            later=None if self.later is None else self.later[at],
        )


COLUMNS = (
    "axis", "group", "torque", "recorded", "rate", "X", "own", "period", "time", "source", "sample",
)  # fmt: skip
"""Attributes of `Evidence` with one element per row."""


def measured(
    robot: Robot,
    solver: SimultaneousFit,
    prepared: Sequence[tuple[ParameterMotion, Signals]],
    *,
    rates: bool = False,
) -> Evidence:
    """Return the rows of measured strokes and trajectories.

    Axes that move without a command are included: two axes may be exchanged.

    Parameters
    ----------
    prepared : sequence of (ParameterMotion, Signals)
        Recordings of the solver.
    rates : bool
        True to test for a change, which needs `Evidence.rate`.
    """
    unasked = []
    for motion, s in prepared:
        for axis in set(range(robot.n_joints)) - set(motion.moved):
            used = s.usable(robot, axis)
            if used.sum() < FEWEST:
                continue
            motor = motor_torque(robot, s.q, s.qd, s.qdd)[:, [axis]]
            torques = np.hstack([s.tau[:, [axis]] - motor, motor])
            found = stack_axis(robot, s, axis, torques, used, list(groups(s)))
            unasked += [(s, [each]) for each in found if each is not None]
    return rows_of(robot, solver.stacked, solver.loaded, unasked, rates=rates)


def step_of(n_rows: int) -> int:
    """Return the number of rows per used row of a channel."""
    return max(1, round(n_rows / MOST))


def rows_of(
    robot: Robot,
    asked: Sequence[tuple[Signals, Sequence[Stacked]]],
    loaded: Mask,
    unasked: Sequence[tuple[Signals, Sequence[Stacked]]] = (),
    *,
    rates: bool = False,
) -> Evidence:
    """Thin out the columns of moving axes, measurement by measurement.

    Parameters
    ----------
    asked : sequence of (Signals, sequence of Stacked)
        Columns of the axes commanded to move.
    loaded : ndarray of bool, shape (n_joints,)
        Axes with friction of the load.
    unasked : sequence of (Signals, sequence of Stacked)
        Further axes that moved.
    rates : bool
        See `measured`.
    """
    stacked = [*asked, *unasked]
    several = -(-FEWEST_GROUPS // max(len({s for s, _ in asked}), 1))
    # periods of a trajectory repeat the error of a friction law, so they share their groups
    place = {s: k for k, s in enumerate(dict.fromkeys(s for s, _ in stacked))}
    parts = []
    for axis in range(robot.n_joints):
        own = [(place[s], s, each) for s, axes in stacked for each in axes if each.axis == axis]
        own.sort(key=lambda part: part[1].time[0])  # later recordings are contiguous
        step = step_of(sum(len(each.index) for *_, each in own))
        parts += [_part(robot, s, each, step, k, several, loaded, rates) for k, s, each in own]
    evidence = gathered(parts)
    limits = [
        limit_or_reached(limit, evidence.recorded[evidence.axis == axis])
        for axis, limit in enumerate(robot.torque_limit)
    ]
    # zero torques carry no information, though rounding of other axes appears there
    rounding = np.finfo(float).eps * (np.abs(evidence.recorded).max(initial=0.0) or 1.0)
    finest = np.maximum(FINEST * np.array(limits), rounding)
    return replace(evidence, finest=finest, signals=tuple(place))


def _part(
    robot: Robot,
    s: Signals,
    each: Stacked,
    step: int,
    place: int,
    several: int,
    loaded: Mask,
    rates: bool,
) -> Evidence:
    """Return the rows of an axis in a measurement, with the basis of friction."""
    some = thinned(np.arange(len(each.index)), step)
    index = each.index[some]
    n_base = len(base_parameters(robot))
    near = np.concatenate([index - 1, index, index + 1])
    smooth = smooth_at(near, np.hstack(s.link), s.period)
    motion = smooth.reshape(3, len(index), 3, -1).swapaxes(1, 2)
    rate = np.zeros(len(index))
    if rates:
        before, _, after = smooth_at(near, s.tau[:, [each.axis]], s.period).reshape(3, -1)
        rate = (after - before) / (2.0 * s.period)
    # changes between samples of an axis at rest are encoder noise
    rest = [k for k in range(robot.n_joints) if not s.moving(robot, k).any()]
    motion[..., rest] = motion[1][..., rest]
    time = s.time[index]
    longest = min(LONGEST, float(np.ptp(time)) / several + s.period)
    number = ((time - time[0]) // longest).astype(np.intp)
    coupled = coupled_friction(robot, motion[1, 1], each.axis)
    Q, _ = orthonormal(np.hstack([each.friction[some], coupled]), SAME)
    own = each.X[some, n_base:].copy()
    if not loaded[each.axis]:
        own[:, LOAD:] = 0.0
    return Evidence(
        axis=np.full(len(index), each.axis),
        group=place * 1000 + number,
        torque=each.torques[some, 0],
        recorded=each.torques[some].sum(axis=1),
        rate=rate,
        X=each.X[some, :n_base],
        own=own,
        motion=motion,
        period=np.full(len(index), s.period),
        time=time,
        parts=((slice(0, len(index)), Q),),
        finest=np.zeros(robot.n_joints),
        signals=(),
        source=np.full(len(index), place),
        sample=index,
    )


def gathered(parts: Sequence[Evidence]) -> Evidence:
    """Concatenate the rows of parts, with groups numbered anew."""
    first, ends = [], 0
    for each in parts:
        first.append(ends)
        ends += len(each.axis)
    stacked: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in parts]) for name in COLUMNS
    }
    stacked["group"] = np.unique(stacked["group"], return_inverse=True)[1]
    stacked["time"] -= stacked["time"].min()
    return replace(
        parts[0],
        **stacked,
        motion=np.concatenate([each.motion for each in parts], axis=2),
        parts=tuple(
            (slice(a + rows.start, a + rows.stop), Q)
            for a, each in zip(first, parts, strict=True)
            for rows, Q in each.parts
        ),
    )
