"""Step 1: a recording condensed to half-sums and half-differences over bins of position.

All columns of the regression go the same way: torque, the motors' known part of it, the rows of the
base parameters, what differs by direction, and friction. In half-sums friction cancels where both
strokes pass at one speed, in half-differences all else where they accelerate alike; what is left
there of either is in its columns. Friction has no law: it is any odd function of the velocity,

    f = sign(v) sum_j c_j h_j(|v|) + sum_k T_k(t) (a_k sign(v) + b_k v).

The h_j interpolate linearly between levels at speeds that the strokes themselves have, so any curve
is among them. Each pair k has a level a_k and a slope b_k of its own at its turning point; between
two pairs the T_k interpolate in time, and go on beyond the first and the last one. A stroke back
always comes later than the one forth, so a trend would shift all half-sums; it is read off the
half-differences of successive pairs, and taken off.

The cut-off is chosen as that of free motions is (`hil.estimation.free_motion.settings`), but from
the axis that moves, and recording by recording: slow strokes over few increments deserve a lower
one than fast ones. Half-sums over bins take noise off by themselves, so torque and columns keep
what positions keep: the narrower the low-pass, the further a reversal reaches into a stroke.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from hil.estimation.back_and_forth.pairs import pairs_of
from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.columns import axis_columns, shared_names
from hil.estimation.free_motion.motion import Processing, filtered_motion, low_passed
from hil.estimation.free_motion.settings import bandwidth, cut_off_of
from hil.estimation.free_motion.survey import SLOWEST, greatest_speed
from hil.friction.ripple import RIPPLE_ORDERS, ripple_orders
from hil.friction.terms import BEND, CLASSICAL, COLUMNS, RIPPLE
from hil.least_squares.solving import inverse
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices, Mask
    from hil.estimation.back_and_forth.pairs import Pairs
    from hil.estimation.free_motion.motion import Motion
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

COMMON = ("offset", "asymmetric", *RIPPLE)
"""What else is the same forth and back, alike in all recordings of an axis: a constant, a part in
proportion to the speed, ripple over the motor's angle."""


@dataclass(frozen=True, eq=False)
class Halves:
    """Half-sums and half-differences of one recording, over pairs and bins.

    Attributes
    ----------
    id : str
    axis : int
        That moves, from 0.
    pairs : Pairs
    rows : ndarray, shape (2, n, 1 + n_known + n_levels)
        Half-sums and half-differences of the torque less that of known rotors, of `known` columns
        and of levels of friction, at unit variance for samples of variance 1.
    alone : ndarray, shape of `rows`
        The same, had all other axes stood still: what such motions show, without what they show by
        chance; the known rotors' column, which is no unknown, is 0.
    q : ndarray, shape (n, n_joints)
        Mean positions [rad or m].
    speed : ndarray, shape (n,)
        Mean of both strokes [rad/s or m/s].
    samples : ndarray
        Inner products of the same columns over all samples of the pairs.
    whole : ndarray, shape (n_pairs, m, m)
        Inner products of the torque, base parameters and `CLASSICAL` friction over all samples of
        each pair, slow ones too.
    also_moving : tuple of int
        Other axes, from 0, that moved along.
    cut_off : float
        Of the low-pass [Hz].
    cut_off_reason : str
    """

    id: str
    axis: int
    pairs: Pairs
    rows: Array
    alone: Array
    q: Array
    speed: Array
    samples: Array
    whole: Array
    also_moving: tuple[int, ...]
    cut_off: float
    cut_off_reason: str

    @cached_property
    def _products(self) -> Array:
        """Inner products of both kinds of columns by half, shape (2, 2, m, m)."""
        return np.stack([np.swapaxes(x, 1, 2) @ x for x in (self.rows, self.alone)])

    def without_levels(self, weights: Array, n: int, *, alone: bool = False) -> Array:
        """Combinations of columns: the first `n`, levels of friction taken off, shape (m, n).

        Both halves have the levels in common, so what these explain depends on their weights,
        shape (2,).
        """
        both = np.tensordot(weights, self._products[int(alone)], 1)
        return np.vstack([np.eye(n), -inverse(both[n:, n:]) @ both[n:, :n]])


def numbered_pairs(recordings: Sequence[Halves]) -> Indices:
    """Number of the pair of each row, recording after recording, from 0."""
    rows = [(k, pair) for k, each in enumerate(recordings) for pair in each.pairs.pair.tolist()]
    return np.unique(rows, axis=0, return_inverse=True)[1].ravel()


def known(robot: Robot) -> tuple[str, ...]:
    """Columns that all recordings of an axis have in common, known rotors' torque among them."""
    return (*base_parameters(robot).names, ROTOR, *COMMON)


def halves_of(robot: Robot, motion: FreeMotion, recording: Recording) -> Halves:
    """Condense one recording of an axis that moves back and forth.

    Raises
    ------
    NotEnoughData
        No pair is of use.
    """
    (axis,) = motion.moved
    processing, reason = _processing(motion, recording)
    # positions pass the low-pass before they become columns; so does the torque
    tau = low_passed(recording.tau, recording.period, processing.cut_off)[0]
    filtered = filtered_motion(replace(recording, tau=tau), processing)
    n = len(filtered.tau)
    stroke = recording.stroke[:: filtered.rates.fine * filtered.rates.coarse][:n]
    pairs = pairs_of(filtered, stroke, axis, robot.position_unit(axis))
    named = _columns(robot, filtered, axis)
    velocity = filtered.passed(filtered.qd[:, [axis]])[:n]
    levels = _levels(velocity[:, 0] / processing.speed[axis], pairs)
    base = base_parameters(robot).names
    columns, classical = (
        np.column_stack([named[name] for name in ("torque", *names)])
        for names in (known(robot), (*base, *CLASSICAL))
    )
    columns = np.hstack([columns, levels])
    still, fixed = _others_still(filtered, axis)
    alone = columns.copy()
    apart = regressor(robot, fixed.q, fixed.qd, fixed.qdd, joints=[axis])[:, 0]
    alone[:, 1 : 1 + len(base)] = fixed.passed(apart)[:n]
    alone[:, 1 + len(base)] = 0.0
    whole = (classical[filtered.used & (stroke // 2 == k)] for k in np.unique(pairs.pair))
    scale = np.sqrt(pairs.weights)[:, np.newaxis]
    return Halves(
        id=motion.id,
        axis=axis,
        pairs=pairs,
        rows=scale * pairs.halves(columns),
        alone=scale * pairs.halves(alone),
        q=pairs.halves(filtered.q[:: filtered.rates.coarse][:n])[0],
        speed=np.abs(pairs.halves(velocity)[1, :, 0]),
        samples=columns[pairs.used].T @ columns[pairs.used],
        whole=np.array([x.T @ x for x in whole]),
        also_moving=tuple(int(j) for j in np.flatnonzero(~still) if j != axis),
        cut_off=processing.cut_off,
        cut_off_reason=reason,
    )


def _processing(motion: FreeMotion, recording: Recording) -> tuple[Processing, str]:
    """Settings of one recording, and why its cut-off is what it is."""
    (axis,) = motion.moved
    width = bandwidth(recording.q[:, axis], recording.period)
    cut_off, reason = cut_off_of([width], recording.period, motion.cut_off)
    none, speed = np.zeros(recording.n_joints), np.ones(recording.n_joints)
    speed[axis] = max(greatest_speed(recording)[axis], SLOWEST)
    return Processing(cut_off, cut_off, speed, none.astype(bool), none, none), reason


def _columns(robot: Robot, motion: Motion, axis: int) -> dict[str, Array]:
    """Torque less the rotors', and columns, at the filtered samples; friction per velocity."""
    rows = regressor(robot, motion.q, motion.qd, motion.qdd, [axis])[:, 0]
    columns = motion.passed(axis_columns(robot, motion, axis, rows, np.zeros(rows.shape[1])))
    names = (*shared_names(robot), ROTOR, *COLUMNS)
    named = dict(zip(names, columns[: len(motion.tau)].T, strict=True))
    for name in ("viscous", "asymmetric"):
        named[name] = named[name] * motion.processing.speed[axis]
    for order in set(RIPPLE_ORDERS).difference(ripple_orders(robot, axis)):
        named[f"cosine {order}"] = named[f"sine {order}"] = np.zeros(len(motion.tau))
    return {**named, "torque": motion.tau[:, axis] - named[ROTOR]}


def _levels(u: Array, pairs: Pairs) -> Array:
    """Columns of friction, shape (n, n_columns), over the velocity as share of the recording's.

    Their rank may be less.
    """
    knots: list[float] = []
    # speeds between which the curve of friction is interpolated, at most: one for each of the
    # fewest bins of position (`hil.estimation.back_and_forth.pairs.BINS`)
    for speed in np.quantile(np.abs(u[pairs.used]), np.linspace(0.0, 1.0, 8)).tolist():
        # closer ones would resolve less than half of what friction bends over
        if not knots or speed >= knots[-1] + BEND / 2:
            knots.append(speed)
    curve = np.column_stack([np.interp(np.abs(u), knots, unit) for unit in np.eye(len(knots))])
    steady = np.ones((len(u), 1))
    if len(pairs) > 1:
        steady = make_interp_spline(pairs.turning, np.eye(len(pairs)), k=1)(np.arange(len(u)))
    direction, u = np.sign(u)[:, np.newaxis], u[:, np.newaxis]
    return np.hstack([direction * curve, direction * steady, u * steady])


def _others_still(motion: Motion, axis: int) -> tuple[Mask, Motion]:
    """Axes that stand still, and the motion with these where they are on average.

    What their controllers let them give way is in the torque, and so in the columns. But it would
    make base parameters seem to be excited that are not.
    """
    ways = np.ptp(motion.q, axis=0)
    # share of the distance of the axis that is to move alone up to which another axis counts as
    # still: what its controller lets it give way
    still = ways <= 0.02 * ways[axis]
    mean = np.where(still, motion.q.mean(axis=0), motion.q)
    qd, qdd = (np.where(still, 0.0, x) for x in (motion.qd, motion.qdd))
    return still, replace(motion, q=mean, qd=qd, qdd=qdd)
