"""Step 1: a recording condensed to half-sums and half-differences over bins of position.

All columns of the regression go the same way: torque, the motors' known part of it, the rows of the
base parameters, what differs by direction, and friction. In half-sums friction cancels where both
strokes pass at one speed, in half-differences all else where they accelerate alike; what is left
there of either is in its columns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData
from hil.estimation.back_and_forth.levels import friction_columns
from hil.estimation.back_and_forth.pairs import pairs_of
from hil.estimation.back_and_forth.settings import processing_of_strokes
from hil.estimation.free_motion.columns import SEEN
from hil.estimation.free_motion.motion import filtered_motion, low_passed
from hil.least_squares.layout import axis_place
from hil.least_squares.ripple import RIPPLE_ORDERS, ripple_orders
from hil.least_squares.terms import multiples
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.pairs import Pair
    from hil.estimation.free_motion.motion import Motion
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Indices = NDArray[np.intp]

STILL = 0.02
"""Way of another axis, as share of the way of the one that is to move alone, below which it counts
as still: what its controller lets it give way."""
COMMON = 2 + 2 * len(RIPPLE_ORDERS)
"""Columns of what else is the same forth and back, alike in all recordings of an axis: a constant,
one in proportion to the speed, ripple over the motor's angle."""
TORQUE, MOTOR, FIRST = 0, 1, 2
"""Places of the columns of torque and its motors' part, and of the first base parameter."""


@dataclass(frozen=True, slots=True, eq=False)
class Halves:
    """Half-sums and half-differences of one recording, over pairs and bins.

    Attributes
    ----------
    id : str
    axis : int
        That moves, from 0.
    sums, differences : ndarray, shape (n, 2 + n_base + COMMON + n_friction)
        Of torque, motors' part, rows of base parameters, what differs by direction, friction.
    excited : ndarray, shape (2 n, n_base)
        Rows of the base parameters in half-sums, then half-differences, had all other axes stood
        still: what such motions show, without what they show by chance.
    weight : ndarray, shape (n,)
        Samples that each half is worth.
    pair, bin : ndarray, shape (n,)
        Numbers in the recording.
    q : ndarray, shape (n, n_joints)
        Mean positions [rad or m].
    speed : ndarray, shape (n,)
        Mean of both strokes [rad/s or m/s].
    samples : ndarray, shape (n_columns, n_columns)
        Inner products of the same columns over all samples of the pairs.
    n_samples : int
    whole : ndarray, shape (n_pairs, 2 + n_base + 3, 2 + n_base + 3)
        Inner products of torque, motors' part, rows, a constant, direction and velocity over all
        samples of each pair, slow ones too.
    greatest_speed : float
        Of the axis in all recordings [rad/s or m/s].
    also_moving : tuple of int
        Other axes, from 0, that moved along.
    useless : tuple of str
        Pairs that were left out, and why.
    cut_off : float
        Of the low-pass [Hz].
    cut_off_reason : str
    """

    id: str
    axis: int
    sums: Array
    differences: Array
    excited: Array
    weight: Array
    pair: Indices
    bin: Indices
    q: Array
    speed: Array
    samples: Array
    n_samples: int
    whole: Array
    greatest_speed: float
    also_moving: tuple[int, ...]
    useless: tuple[str, ...]
    cut_off: float
    cut_off_reason: str

    @property
    def n_pairs(self) -> int:
        """Pairs that are used."""
        return len(np.unique(self.pair))


def halves_of(robot: Robot, motion: FreeMotion, recording: Recording, speed: Array) -> Halves:
    """Condense one recording of an axis that moves back and forth.

    Parameters
    ----------
    speed : ndarray, shape (n_joints,)
        Of each axis in all recordings [rad/s or m/s].

    Raises
    ------
    NotEnoughData
        No pair is of use.
    """
    (axis,) = motion.moved
    processing, reason = processing_of_strokes(motion, recording)
    # positions pass the low-pass before they become columns; so does the torque
    tau = low_passed(recording.tau, recording.period, processing.cut_off)[0]
    filtered = filtered_motion(replace(recording, tau=tau), processing)
    every = filtered.rates.fine * filtered.rates.coarse
    stroke, pair = (x[::every][: len(filtered.tau)] for x in (recording.stroke, recording.pair))
    pairs, useless = pairs_of(filtered, stroke, axis, robot.position_unit(axis))
    if not pairs:
        raise NotEnoughData(_why_none(useless))
    still, alone = _others_still(filtered, axis)
    columns, u = _columns(robot, filtered, axis, speed[axis], pairs)
    rows = alone.passed(_rows(robot, alone, axis))[: len(u)]
    used = np.concatenate([np.concatenate([pair.forth, pair.back]) for pair in pairs])
    together = np.column_stack([columns, rows, u, _coarse(filtered)])
    sums, differences = (
        np.vstack(each) for each in zip(*(pair.halves(together) for pair in pairs), strict=True)
    )
    k = columns.shape[1]
    mine = slice(k, k + rows.shape[1])
    return Halves(
        id=motion.id,
        axis=axis,
        sums=sums[:, :k],
        differences=differences[:, :k],
        excited=np.vstack([sums[:, mine], differences[:, mine]]),
        weight=np.concatenate([pair.weights for pair in pairs]),
        pair=np.repeat([pair.number for pair in pairs], [len(pair.bins) for pair in pairs]),
        bin=np.concatenate([pair.bins for pair in pairs]),
        q=sums[:, mine.stop + 1 :],
        speed=np.abs(differences[:, mine.stop]),
        samples=columns[used].T @ columns[used],
        n_samples=len(used),
        whole=_whole(columns[:, : 2 + len(base_parameters(robot))], filtered, pair, pairs, axis),
        greatest_speed=float(speed[axis]),
        also_moving=tuple(int(j) for j in np.flatnonzero(~still) if j != axis),
        useless=tuple(useless),
        cut_off=processing.cut_off,
        cut_off_reason=reason,
    )


def _why_none(useless: Sequence[str]) -> str:
    if not useless:
        return (
            "no stroke forth has one back after it; record at least one pair, or write kind: free"
        )
    more = len(useless) - 1
    also = f" (and {more} more pair{'s' if more > 1 else ''})" if more else ""
    return f"{useless[0]}{also}"


def _others_still(motion: Motion, axis: int) -> tuple[NDArray[np.bool_], Motion]:
    """Axes that stand still, and the motion with these where they are on average.

    What their controllers let them give way is in the torque, and so in the columns. But it would
    make base parameters seem to be excited that are not.
    """
    ways = np.ptp(motion.q, axis=0)
    still = ways <= STILL * ways[axis]
    mean = np.where(still, motion.q.mean(axis=0), motion.q)
    qd, qdd = (np.where(still, 0.0, x) for x in (motion.qd, motion.qdd))
    return still, replace(motion, q=mean, qd=qd, qdd=qdd)


def _columns(
    robot: Robot, motion: Motion, axis: int, greatest: float, pairs: Sequence[Pair]
) -> tuple[Array, Array]:
    """All columns at the filtered samples, and the velocity [rad/s or m/s]."""
    motor = motor_torque(robot, motion.q, motion.qd, motion.qdd)[:, [axis]]
    rows = _rows(robot, motion, axis)
    passed = motion.passed(np.hstack([motor, rows, motion.qd[:, [axis]]]))[: len(motion.tau)]
    qd = passed[:, -1]
    share = qd / motion.processing.speed[axis]
    time: Array = motion.period * motion.rates.coarse * np.arange(len(qd), dtype=np.float64)
    common = np.column_stack([np.ones(len(qd)), np.abs(qd) / greatest])
    ripple = motion.passed(_ripple(robot, motion, axis))[: len(qd)]
    columns = [motion.tau[:, [axis]], passed[:, :-1], common, ripple]
    return np.hstack([*columns, friction_columns(share, time, pairs)]), qd


def _ripple(robot: Robot, motion: Motion, axis: int) -> Array:
    """Cosines and sines of the motor's angle that look like nothing else, shape (n, 2 n_orders)."""
    orders = np.array(RIPPLE_ORDERS)
    held = np.isin(orders, ripple_orders(robot, axis))
    if not held.any():
        return np.zeros((len(motion.q), 2 * len(orders)))
    turns = np.abs(robot.gear_ratio[axis] * motion.qd[:, axis]) * motion.period / math.tau
    seen = held[:, np.newaxis] & (orders[:, np.newaxis] * turns < SEEN)
    waves = multiples(robot.gear_ratio[axis] * motion.q[:, axis], RIPPLE_ORDERS) * seen
    return np.vstack([waves.real, waves.imag]).T


def _whole(
    columns: Array, motion: Motion, pair: NDArray[np.int16], pairs: Sequence[Pair], axis: int
) -> Array:
    """Inner products of columns and of classical friction's over all of each pair."""
    qd = motion.qd[:, axis]
    friction = np.column_stack([np.ones_like(qd), motion.direction_after(axis, 0.0), qd])
    every = np.hstack([columns, motion.passed(friction)[: len(columns)]])[motion.used]
    own = pair[motion.used]
    return np.array([every[own == each.number].T @ every[own == each.number] for each in pairs])


def _rows(robot: Robot, motion: Motion, axis: int) -> Array:
    return regressor(robot, motion.q, motion.qd, motion.qdd, joints=[axis])[:, 0]


def _coarse(motion: Motion) -> Array:
    """Positions at the filtered samples."""
    return motion.q[:: motion.rates.coarse][: len(motion.tau)]


def unknown_places(robot: Robot, axis: int) -> Indices:
    """Where an axis's columns stand among all unknowns: base parameters, then by axis `COMMON`."""
    return axis_place(len(base_parameters(robot)), COMMON, axis)
