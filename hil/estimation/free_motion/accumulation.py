"""Condense recordings to inner products of columns by piece of time and cell of states.

The samples of every axis in every piece of time, and in every cell of the state space, become a
small matrix over the columns

    y | A(q, qd, qdd), coupled motors, friction

of filtered samples (`hil.least_squares.blocks`): first with the recorded signal for y and the
torque of rotors of known inertia as a further column (`recorded_products`), then with the torque to
be explained (`scaling`). Pieces are also divided by the speed of the axis, so that a dead zone can
be chosen afterwards. A cell holds samples of similar positions and velocities at any time: the
samples nearest to one of some states drawn from the motion. Model errors repeat whenever the motion
repeats; over cells they scatter. Ripple and other errors of a drive train repeat wherever its axis
passes, so samples are divided by the axis's own position as well.

With instruments, products of all columns with the columns of a second motion are added
(`motion.filtered_motion`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.arrays import side_by_side
from hil.errors import NotEnoughData
from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.columns import axis_columns, shared_names, soft_gears
from hil.estimation.free_motion.motion import changing
from hil.friction.law import SLOWEST
from hil.friction.terms import COLUMNS
from hil.least_squares.blocks import Blocks
from hil.least_squares.choice import FOLDS
from hil.least_squares.normal_equations import successive
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.least_squares.layout import Layout
    from hil.model.robot import Robot

PERIODS = 10.0
"""Shortest independent piece of time, in periods of the cut-off frequency."""
SPEEDS = (SLOWEST, 0.05, 0.1)
"""Candidate dead zones: bounds of the classes of speed as shares of the axis's speed."""


@dataclass(frozen=True, slots=True)
class Division:
    """Division of samples into pieces of time and cells of states.

    Attributes
    ----------
    piece : float
        Length of a piece [s].
    states : ndarray, shape (n_cells, 2 n_joints)
        Centres of the cells: positions and velocities over `scale`; empty without stretches.
    scale : ndarray, shape (2 n_joints,)
    ranges : ndarray, shape (2, n_joints)
        Lowest position of each axis, and range of its positions [rad or m].
    """

    piece: float
    states: Array
    scale: Array
    ranges: Array

    def cells(self, motion: Motion) -> Indices:
        """Return the cell of every used sample and axis, shape (n_partitions, n_used, n_joints).

        The first partition is by state, the second by the axis's own position; none without
        stretches.
        """
        states, n = _states(motion)[motion.used], len(self.states)
        if not n:
            return np.zeros((0, *states[:, ::2].shape), np.intp)
        low, width = self.ranges
        share = (states[:, : len(low)] - low) / width
        of_state = np.repeat(_nearest(self.states, states / self.scale)[:, None], len(low), axis=1)
        return np.array([of_state, n + np.clip((share * n).astype(np.intp), 0, n - 1)])


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Inner products of the columns of the regression.

    Shared columns are base parameters, friction of coupled motors, compliances of soft gears and
    added columns; own columns are those of friction, `COLUMNS`.

    Attributes
    ----------
    pieces : tuple of Blocks
        By piece of time, labelled by the number of its recording: of all samples, then of the
        samples in each class of speed and faster.
    cells : tuple of Blocks
        By cell of states, then by cell of an axis's own position, labelled "partition"; for the
        same classes of speed.
    ways : ndarray, shape (n_joints, 2)
        Numbers of samples in which an axis moves forward and back, faster than the least dead zone.
    instruments : Blocks, optional
        Products of columns of one half of the samples with those of the other half, by piece.
    """

    pieces: tuple[Blocks, ...]
    cells: tuple[Blocks, ...]
    ways: Array
    instruments: Blocks | None = None

    @property
    def n_joints(self) -> int:
        """Number of axes."""
        return self.pieces[0].n_channels

    @property
    def n_pieces(self) -> int:
        """Number of pieces of time."""
        return len(self.pieces[0])

    @property
    def layout(self) -> Layout:
        """Layout of the unknowns."""
        return self.pieces[0].layout

    def recast(
        self,
        torque: Array | None = None,
        added: Mapping[str, Array] | None = None,
        dropped: Sequence[str] = (),
    ) -> Products:
        """Return products for another torque or other shared columns, as `Blocks.recast` does.

        Time-dependent columns, shape (n_pieces, n_joints, m), are 0 in cells, which have no time:
        their torque lacks the drift (`recorded_products`).
        """
        new, crossed = added or {}, self.instruments
        of_cells = {name: 0.0 * x[0] if x.ndim == 3 else x for name, x in new.items()}
        return Products(
            tuple(each.recast(torque, new, dropped) for each in self.pieces),
            tuple(each.recast(torque, of_cells, dropped) for each in self.cells),
            self.ways,
            None if crossed is None else crossed.recast(torque, new, dropped),
        )


def division(
    processing: Processing,
    duration: float,
    stretches: Sequence[Motion] = (),
    usable: tuple[int, float] | None = None,
) -> Division:
    """Divide recordings of a `duration` [s] into pieces, and `stretches` into cells of states.

    Pieces have 10 periods of the cut-off frequency or more. Where the recordings `usable` (number,
    and total duration without spoilt ends [s]) then have fewer pieces than cross-validation has
    folds, pieces are shorter, down to 5 periods. Errors from such pieces are 1.2 % too small for
    white noise, since neighbours share filtered noise, but fewer pieces leave an error uncertain by
    a fifth or more, and hardly any difference between friction laws significant.
    """
    n, least = 2 * len(processing.speed), PERIODS / processing.band
    if usable is not None and usable[0] < FOLDS:
        # rounding takes half a piece of each recording at most
        enough = usable[1] / (FOLDS + usable[0] / 2)
        least = min(least, max(enough, 5.0 / processing.band))
    piece = max(duration / 120, least)  # about 120 pieces over all recordings
    if not stretches:
        return Division(piece, np.zeros((0, n)), np.ones(n), np.ones((2, n // 2)))
    states = np.vstack([_states(motion)[motion.used] for motion in stretches])
    scale, q = _scale(states), states[:, : n // 2]
    ranges = np.array([q.min(axis=0), np.maximum(np.ptp(q, axis=0), 1e-9)])
    return Division(piece, _middles(states / scale), scale, ranges)


def _states(motion: Motion) -> Array:
    return np.hstack([motion.q, motion.qd])[:: motion.rates.coarse]


def _middles(states: Array) -> Array:
    """Return states covering the motion: evenly drawn in time, then moved to cell means."""
    # 60 cells of the state space
    found: Array = states[np.linspace(0, len(states) - 1, min(60, len(states))).astype(int)]
    some = states[:: max(1, len(states) // 5000)]
    for _ in range(5):
        nearest = _nearest(found, some)
        sums = np.zeros_like(found)
        np.add.at(sums, nearest, some)
        counts = np.bincount(nearest, minlength=len(found))[:, np.newaxis]
        found = np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), found))
    # a path from neighbour to neighbour, so that successive cells can be merged
    order, left = [0], list(range(1, len(found)))
    while left:
        order.append(left.pop(int(_nearest(found[left], found[order[-1:]])[0])))
    return found[order]


def _nearest(middles: Array, states: Array) -> Indices:
    """Return the number of the nearest centre of every state."""
    square = (middles**2).sum(axis=1)
    return np.asarray(np.argmin(square - 2.0 * states @ middles.T, axis=1))


def cells_of(states: Array) -> Indices:
    """Return the cell of every state, shape (n, k), after scaling by standard deviations."""
    scaled = states / _scale(states)
    return _nearest(_middles(scaled), scaled)


def _scale(states: Array) -> Array:
    """Return standard deviations with a lower bound above rounding errors of constant states."""
    found: Array = np.maximum(states.std(axis=0), 1e-9)
    return found


def recorded_products(
    robot: Robot,
    motions: Iterable[Motion],
    divided: Division,
    first: Array,
    terms: tuple[str, ...] = COLUMNS,
    *,
    instruments: bool = False,
    soft: tuple[int, ...] = (),
    drifting: Array | None = None,
) -> Products:
    """Condense motions with the recorded signals as torque.

    The torque of the rotors whose inertia is known is the last of the shared columns, `ROTOR`.

    Parameters
    ----------
    first : ndarray, shape (n_base,)
        First estimate of the base parameters, for load-dependent friction.
    terms : tuple of str
        Terms of friction, in the order of `COLUMNS`.
    instruments : bool
        Compute products of one half of the samples with the other half.
    soft : tuple of int
        Axes with soft gears, from 0.
    drifting : ndarray, shape (n_pieces, n_joints, n_terms), optional
        Friction by piece, not part of the torque in cells (`Drift.beyond_mean`).

    Raises
    ------
    NotEnoughData
        All recordings are shorter than the filter's reach.
    """
    shared = (*shared_names(robot, soft), ROTOR)
    m = 1 + len(shared) + len(terms)
    cells = Groups.empty(2 * len(divided.states), robot.n_joints, m)
    pieces: list[Groups] = []
    crossed: list[Array] = []
    origin: list[int] = []
    longest, spoilt = 0.0, 0.0
    ways = np.zeros((robot.n_joints, 2))
    for number, motion in enumerate(motions):
        longest = max(longest, motion.recording.n_samples * motion.rates.period)
        spoilt = max(spoilt, motion.spoilt)
        parts = pieces_of(motion, divided.piece)
        if not parts:
            continue
        own = Groups.empty(len(parts), robot.n_joints, m)
        time = np.repeat(np.arange(len(parts)), [part.stop - part.start for part in parts])
        of_cells = divided.cells(motion)
        speeds = np.digitize(motion.slowest[motion.used], SPEEDS)
        used = slice(parts[0].start, parts[-1].stop)
        qd = motion.qd[:: motion.rates.coarse][used]
        moves = motion.telling[used] & motion.processing.moves(qd)
        ways += np.transpose([(moves & (way * qd > 0)).sum(axis=0) for way in (1, -1)])
        every = every_axis(robot, motion, first, motion.tau, terms, soft)
        for axis, rows in enumerate(each[used] for each in every):
            some = motion.telling[used, axis]
            if not some.any():
                continue
            heard, speed = rows[some], speeds[some, axis]
            own.add(axis, heard, time[some], speed)
            if drifting is not None:
                friction = drifting[len(origin) + time[some], axis]
                heard[:, 0] -= (heard[:, -len(terms) :] * friction).sum(axis=1)
            for each in of_cells:
                cells.add(axis, heard, each[some, axis], speed)
        pieces.append(own)
        origin += [number] * len(parts)
        if instruments:
            crossed.append(_crossed(robot, motion, parts, first, terms, soft))
    if not pieces:
        raise too_short(longest, spoilt, motion.processing)
    columns = shared, terms
    by_time = Groups.joined(pieces).speed_classes(*columns, {"recording": np.array(origin)})
    other = None
    if instruments:
        other = Blocks(*columns, np.concatenate(crossed), by_time[0].counts)
    by = {"partition": np.repeat([0, 1], len(divided.states))}
    return Products(by_time, cells.speed_classes(*columns, by), ways, other)


def too_short(longest: float, spoilt: float, processing: Processing) -> NotEnoughData:
    """Return the error for recordings completely spoilt by the low-pass; times in s."""
    return NotEnoughData(
        f"the longest recording has {longest:.3g} s, and the low-pass at "
        f"{processing.cut_off:.3g} Hz makes {spoilt:.3g} s at the ends unusable; import longer "
        "ones, or state a higher cut_off in the map"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Accumulators of inner products and counts by class of speed, group and axis."""

    products: Array
    counts: Array

    @classmethod
    def empty(cls, n: int, n_joints: int, m: int, n_bounds: int = len(SPEEDS)) -> Groups:
        """Create groups of `m` columns, with classes of speed between `n_bounds` bounds."""
        lead = n_bounds + 1, n, n_joints
        return cls(np.zeros((*lead, m, m)), np.zeros(lead))

    @classmethod
    def joined(cls, each: Sequence[Groups]) -> Groups:
        """Join groups of several motions."""
        both = [(part.products, part.counts) for part in each]
        return cls(*(np.concatenate(parts, axis=1) for parts in zip(*both, strict=True)))

    def add(self, axis: int, rows: Array, group: Indices, speed: Indices) -> None:
        """Add samples of an axis, shape (n, m), to the given groups and classes of speed."""
        shape = self.counts.shape[:2]
        number = speed * shape[1] + group
        order = np.argsort(number, kind="stable")
        heard = np.flatnonzero(changing(rows) | (rows[0] != 0.0))
        columns = np.empty((len(heard), len(rows)))
        for column, row in zip(columns, rows.T[heard], strict=True):
            np.take(row, order, out=column, mode="clip")  # other modes make an additional copy
        ends = np.searchsorted(number[order], np.arange(shape[0] * shape[1] + 1))
        self.counts[:, :, axis] += np.diff(ends).reshape(shape)
        at = np.ix_(heard, heard)
        for k in np.flatnonzero(np.diff(ends)).tolist():
            part = columns[:, ends[k] : ends[k + 1]]
            self.products[*divmod(k, shape[1]), axis][at] += part @ part.T

    def speed_classes(
        self,
        shared: tuple[str, ...],
        own: tuple[str, ...],
        labels: Mapping[str, Indices] | None = None,
    ) -> tuple[Blocks, ...]:
        """Return blocks of every class of speed including the faster classes."""
        for k in reversed(range(len(self.counts) - 1)):
            self.products[k] += self.products[k + 1]
            self.counts[k] += self.counts[k + 1]
        both = zip(self.products, self.counts, strict=True)
        return tuple(Blocks(shared, own, *each, labels=labels or {}) for each in both)


def _crossed(
    robot: Robot,
    motion: Motion,
    parts: Sequence[slice],
    first: Array,
    terms: tuple[str, ...],
    soft: tuple[int, ...],
) -> Array:
    """Return products of the two halves of the samples, shape (n_parts, n_joints, m, m)."""
    # a function, so that the halves are freed before the next motion
    both = (motion.half(half) for half in (1, 2))
    axes = (every_axis(robot, each, first, motion.tau, terms, soft) for each in both)
    found = [[Z[part].T @ W[part] for part in parts] for W, Z in zip(*axes, strict=True)]
    return np.stack(found, axis=1)


def every_axis(
    robot: Robot,
    motion: Motion,
    first: Array,
    y: Array,
    terms: tuple[str, ...],
    soft: tuple[int, ...],
) -> Iterator[Array]:
    """Yield torque and columns of every axis, filtered; zeros while an axis is held."""
    A = regressor(robot, motion.q, motion.qd, motion.qdd)
    gears = soft_gears(robot, motion, first, soft)
    for axis in range(robot.n_joints):
        columns = axis_columns(robot, motion, axis, A[:, axis], first, terms, gears)
        passed = motion.passed(columns, axis)
        rows = side_by_side(y[: len(passed), axis], passed[: len(y)])
        rows *= motion.telling[: len(rows), [axis]] & (axis not in motion.processing.held)
        yield remove_levels(motion, axis, rows)


def remove_levels(motion: Motion, axis: int, rows: Array) -> Array:
    """Subtract from rows, shape (n, m), the mean over each long rest of an axis, in place.

    Static friction has any level up to Coulomb friction, about the same throughout a rest, whatever
    the other axes do. Several pieces of time would show this level as one offset.
    """
    for rest in long_rests(motion, axis):
        rows[rest] -= rows[rest].mean(axis=0)
    return rows


def long_rests(motion: Motion, axis: int) -> list[slice]:
    """Return the rests of a moving axis, beside moving ones, of two pieces of time or more.

    None unless their level is not used.
    """
    processing, every = motion.processing, motion.rates.coarse
    still = processing.rest is not None and np.isfinite(processing.rest[axis])
    if still or processing.rests != "level":
        return []
    moves = processing.moves(motion.qd[::every][: len(motion.used)])
    change = np.diff((motion.used & ~moves[:, axis]).astype(int), prepend=0, append=0)
    least = 2.0 * PERIODS / (processing.band * motion.period * every)
    ends = np.flatnonzero(change).reshape(-1, 2).tolist()
    return [slice(a, b) for a, b in ends if b - a > least and moves[a:b].any()]


def pieces_of(motion: Motion, length: float) -> list[slice]:
    """Divide the used samples into pieces of about equal length."""
    used = np.flatnonzero(motion.used)
    if len(used) < 2:
        return []
    n = max(1, round(motion.duration / length))
    return successive(int(used[0]), int(used[-1]) + 1, n)
