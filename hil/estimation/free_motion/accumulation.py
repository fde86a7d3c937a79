"""All recordings condensed to inner products, recording by recording.

Every axis's share of every piece of time, and of every cell of the space of states, becomes a small
matrix over the columns

    y | A(q, qd, qdd), coupled motors, friction

of filtered samples: first with the signal as it was recorded for y and the torque of rotors of
known inertia as a further column (`recorded_products`), then of the torque to be explained
(`scaling`). Pieces are divided by the axis's speed too, so that a dead zone can be chosen
afterwards. Cells are samples that are alike in positions and velocities, wherever in time they are:
the nearest of some states that were drawn from the motion. What a model cannot explain repeats
whenever the motion does; over cells it scatters.

With instruments there are besides the products of all columns with those of a second motion
(`motion.filtered_motion`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.free_motion.columns import axis_columns, n_shared, rotor_torque
from hil.estimation.free_motion.friction_terms import COLUMNS
from hil.estimation.free_motion.motion import filtered_motion
from hil.regression.normal_equations import successive

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.model.robot import Robot
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

SPEEDS = (0.02, 0.05, 0.1)
"""Bounds of the classes of speed, as shares of the axis's speed: dead zones that are tried."""
PIECES = 120
"""Pieces of all recordings together, about."""
SHORTEST = 10.0
"""Of a piece, in periods of the equation's cut-off frequency."""
CELLS = 60
"""Of the space of states."""


@dataclass(frozen=True, slots=True)
class Division:
    """How samples are divided.

    Attributes
    ----------
    piece : float
        Length of a piece [s].
    states : ndarray, shape (n_cells, 2 n_joints)
        Middles of the cells: positions and velocities over `scale`.
    scale : ndarray, shape (2 n_joints,)
    """

    piece: float
    states: Array
    scale: Array

    def cells(self, motion: Motion) -> Indices:
        """Cell of each sample that is used, shape (n_used,)."""
        state = np.hstack([motion.q, motion.qd])[:: motion.rates.coarse] / self.scale
        return _nearest(self.states, state)


@dataclass(frozen=True, slots=True, eq=False)
class Products:
    """Inner products of all columns.

    Attributes
    ----------
    pieces : ndarray, shape (n_pieces, n_joints, n_speeds, m, m)
        The torque is column 0; classes of speed from the slowest.
    counts : ndarray, shape (n_pieces, n_joints, n_speeds)
        Samples behind them.
    cells : ndarray, shape (n_cells, n_joints, n_speeds, m, m)
    instruments : ndarray, shape (n_pieces, n_joints, m, m), optional
        Products of columns of one half of the samples with those of the other half.
    squares : ndarray, shape (n_joints,)
        Sum of the squares of the torque as it was recorded, filtered.
    n_shared : int
        Columns after the first that all axes share; the rest is the axis's friction.
    recording : ndarray, shape (n_pieces,)
        Number of the recording that each piece is of.
    """

    pieces: Array
    counts: Array
    cells: Array
    instruments: Array | None
    squares: Array
    n_shared: int
    recording: Indices

    @property
    def n_joints(self) -> int:
        """Axes."""
        return len(self.squares)


def division(processing: Processing, stretches: Iterable[Recording], duration: float) -> Division:
    """Divide recordings of some `duration` [s], cells as `stretches` of them show the motion.

    Raises
    ------
    NotEnoughData
        All stretches are shorter than the filter's reach.
    """
    motions = [filtered_motion(each, processing) for each in stretches]
    states = np.vstack([np.hstack([m.q, m.qd])[:: m.rates.coarse][m.used] for m in motions])
    if not len(states):
        raise _too_short(processing)
    scale = np.maximum(states.std(axis=0), 1e-9)
    return Division(
        piece=max(duration / PIECES, SHORTEST / processing.band),
        states=_middles(states / scale),
        scale=scale,
    )


def _middles(states: Array) -> Array:
    """States that cover the motion: drawn evenly in time, then moved to their cells' means."""
    found: Array = states[np.linspace(0, len(states) - 1, min(CELLS, len(states))).astype(int)]
    some = states[:: max(1, len(states) // 5000)]
    for _ in range(5):
        nearest = _nearest(found, some)
        sums = np.zeros_like(found)
        np.add.at(sums, nearest, some)
        counts = np.bincount(nearest, minlength=len(found))[:, np.newaxis]
        found = np.asarray(np.where(counts > 0, sums / np.maximum(counts, 1), found))
    return found


def _nearest(middles: Array, states: Array) -> Indices:
    """Number of the middle that each state is nearest to."""
    square = (middles**2).sum(axis=1)
    return np.asarray(np.argmin(square - 2.0 * states @ middles.T, axis=1))


def cells_of(states: Array) -> Indices:
    """Cell of each of some states, shape (n, k), in units in which they vary alike."""
    return _nearest(_middles(states), states)


def recorded_products(
    robot: Robot,
    recorded: Iterable[Recording],
    processing: Processing,
    divided: Division,
    first: Array,
    *,
    instruments: bool = False,
) -> Products:
    """Condense recordings, the signal as it was recorded.

    The torque of the rotors whose inertia is known is the last of the shared columns.

    Parameters
    ----------
    first : ndarray, shape (n_base,)
        First estimate of the base parameters, for what friction knows of the load.
    instruments : bool
        Whether products of one half of the samples with the other are wanted.

    Raises
    ------
    NotEnoughData
        All recordings are shorter than the filter's reach.
    """
    sums = _Sums(robot, processing, divided, first)
    for number, recording in enumerate(recorded):
        sums.add(number, recording, instruments=instruments)
    if not sums.pieces:
        raise _too_short(processing)
    return Products(
        pieces=np.concatenate(sums.pieces),
        counts=np.concatenate(sums.counts),
        cells=sums.cells,
        instruments=np.concatenate(sums.crossed) if instruments else None,
        squares=sums.squares,
        n_shared=n_shared(robot) + 1,
        recording=np.array(sums.origin),
    )


def _too_short(processing: Processing) -> NotEnoughData:
    return NotEnoughData(
        f"no recording is longer than {2e-3 * processing.spoilt(1e-3):.2g} s, of which the low-pass"
        f" at {processing.cut_off:.3g} Hz spoils both ends; import longer ones, or state a higher"
        " cut_off in the map"
    )


class _Sums:
    """What `recorded_products` adds up."""

    def __init__(
        self, robot: Robot, processing: Processing, divided: Division, first: Array
    ) -> None:
        self._robot, self._processing = robot, processing
        self._divided, self._first = divided, first
        self._m, self._n_speeds = 2 + n_shared(robot) + len(COLUMNS), len(SPEEDS) + 1
        n = robot.n_joints
        self.pieces: list[Array] = []
        self.counts: list[Array] = []
        self.crossed: list[Array] = []
        self.origin: list[int] = []
        self.cells = np.zeros((len(divided.states), n, self._n_speeds, self._m, self._m))
        self.squares = np.zeros(n)

    def add(self, number: int, recording: Recording, *, instruments: bool) -> None:
        """Add one recording, unless it is shorter than the filter reaches."""
        motion = filtered_motion(recording, self._processing)
        parts = _parts(motion, self._divided.piece)
        if not parts:
            return
        self.squares += (motion.tau[motion.used] ** 2).sum(axis=0)
        self._add_pieces(motion, parts)
        if instruments:
            self._add_instruments(recording, parts, motion.tau)
        self.origin += [number] * len(parts)

    def _add_pieces(self, motion: Motion, parts: Sequence[slice]) -> None:
        lead = len(parts), self._robot.n_joints, self._n_speeds
        share, count = np.zeros((*lead, self._m, self._m)), np.zeros(lead)
        of_cell, slowest = self._divided.cells(motion), motion.slowest
        for axis in range(self._robot.n_joints):
            columns = self._stacked(motion, axis, motion.tau)
            speed = np.digitize(slowest[:, axis], SPEEDS)
            for s in range(self._n_speeds):
                _add_cells(self.cells[:, axis, s], columns, of_cell, motion.used & (speed == s))
                for k, part in enumerate(parts):
                    rows = columns[part][speed[part] == s]
                    share[k, axis, s], count[k, axis, s] = rows.T @ rows, len(rows)
        self.pieces.append(share)
        self.counts.append(count)

    def _add_instruments(self, recording: Recording, parts: Sequence[slice], y: Array) -> None:
        half, other = (filtered_motion(recording, self._processing, offset=k) for k in (1, 2))
        cross = np.zeros((len(parts), self._robot.n_joints, self._m, self._m))
        for axis in range(self._robot.n_joints):
            W, Z = self._stacked(half, axis, y), self._stacked(other, axis, y)
            cross[:, axis] = [Z[part].T @ W[part] for part in parts]
        self.crossed.append(cross)

    def _stacked(self, motion: Motion, axis: int, y: Array) -> Array:
        modelled = axis_columns(self._robot, motion, axis, self._first)
        rotor = rotor_torque(self._robot, motion, axis)
        columns = motion.passed(np.insert(modelled, n_shared(self._robot), rotor, axis=1))
        return np.hstack([y[: len(columns), axis, np.newaxis], columns[: len(y)]])


def _parts(motion: Motion, length: float) -> list[slice]:
    """Pieces of about equal length of the samples that are used."""
    used = np.flatnonzero(motion.used)
    if len(used) < 2:
        return []
    n = max(1, round(len(used) * motion.period * motion.rates.coarse / length))
    return successive(int(used[0]), int(used[-1]) + 1, n)


def _add_cells(cells: Array, columns: Array, of_cell: Indices, used: NDArray[np.bool_]) -> None:
    order = np.argsort(of_cell[used], kind="stable")
    rows, which = columns[used][order], of_cell[used][order]
    ends = np.searchsorted(which, np.arange(len(cells) + 1))
    for cell, (a, b) in enumerate(pairwise(ends)):
        if b > a:
            cells[cell] += rows[a:b].T @ rows[a:b]
