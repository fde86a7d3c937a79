"""Condense a recording to half-sums and half-differences over bins of position (step 1).

All columns of the regression are condensed alike: torque, known rotor torque, the base parameters'
rows, direction-dependent terms, and friction. In half-sums friction cancels if both strokes pass at
equal speeds; in half-differences everything else cancels if both strokes accelerate alike. If
speeds or accelerations differ, the columns contain the remainders. No friction law is assumed:
friction is any odd function of the velocity,

    f = sign(v) sum_j c_j h_j(|v|) + sum_k T_k(t) (a_k sign(v) + b_k v).

The h_j interpolate linearly between levels at speeds of the strokes themselves, so any curve is
represented. Each pair k has a level a_k and a slope b_k of its own at its turning point; between
two pairs the T_k interpolate in time, and extrapolate beyond the first and the last one. A stroke
back always comes later than the stroke forth, so a trend would shift all half-sums; the
half-differences of successive pairs determine the trend, which is removed.

The cut-off is chosen as for free motions (`hil.estimation.free_motion.settings`), but from the
moving axis, and recording by recording: slow strokes over few increments need a lower cut-off than
fast ones. Half-sums over bins average noise already, so torque and columns keep the bandwidth of
the positions: the narrower the low-pass, the further a reversal spreads into a stroke.

A pair of strokes is a stroke forth and the following stroke back, as numbered by the import.
Samples near a reversal, where friction is no function of the velocity, are left out. Bins of
position hold about equally many samples, and per stroke at least those of one period of the
low-pass, so bins are narrow where the axis is slow and its speed changes quickly with position.
Each bin passed by both strokes of a pair gives two rows: half the sum and half the difference of
the means.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import make_interp_spline

from hil.errors import NotEnoughData
from hil.estimation.condensed import ROTOR
from hil.estimation.free_motion.columns import axis_columns, shared_names
from hil.estimation.free_motion.motion import COARSE, Processing, filtered_motion, low_passed
from hil.estimation.free_motion.settings import bandwidth, cut_off_of, spectrum
from hil.estimation.free_motion.survey import SLOWEST, greatest_speed
from hil.friction.equation import SLOW
from hil.friction.ripple import RIPPLE_ORDERS, ripple_orders
from hil.friction.terms import BEND, CLASSICAL, COLUMNS, RIPPLE
from hil.least_squares.solving import inverse
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices, Mask, Numbers
    from hil.estimation.free_motion.motion import Motion
    from hil.model.robot import Robot
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording


FEWEST = 4
"""Fewest bins passed by both strokes of a pair: two for each unknown of the pair, a level and a
slope of friction."""
BINS = 2 * FEWEST, 60
"""Minimum and maximum number of bins over the whole distance. The maximum gives bins of 3 degrees
for half a turn; within a bin, link columns (of degree two in sines and cosines) change by a tenth.
"""
UNLIKE = 1.5
"""Largest ratio of the speeds forth and back at equal positions. The torque error was 0.34 % at a
ratio of 1.2, and 0.08 % at 1 (benchmarks/back_and_forth.py).
"""


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Usable pairs of a recording and the rows of the regression: bins of a pair, pair after pair.

    Attributes
    ----------
    forth, back : ndarray of int
        Filtered samples of the strokes.
    rows : tuple of ndarray of int
        Row of each sample, forth and back.
    pair, bin : ndarray of int, shape (n_rows,)
        Numbers in the recording, from 0.
    turning : ndarray, shape (n_pairs,)
        Turning points of the pairs, in filtered samples.
    useless : tuple of str
        Rejected pairs with reasons.
    """

    forth: Indices
    back: Indices
    rows: tuple[Indices, Indices]
    pair: Indices
    bin: Indices
    turning: Array
    useless: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.turning)

    @property
    def used(self) -> Indices:
        """Filtered samples of the strokes."""
        return np.concatenate([self.forth, self.back])

    @property
    def weights(self) -> Array:
        """Inverse variance of each row for unit sample variance, shape (n_rows,)."""
        forth, back = map(np.bincount, self.rows)
        return 4.0 / (1.0 / forth + 1.0 / back)

    def halves(self, x: Array) -> Array:
        """Return half-sums and half-differences, shape (2, n_rows, k), of columns (n, k)."""
        sums = np.zeros((2, len(self.pair), x.shape[1]))
        for k, samples in enumerate((self.forth, self.back)):
            np.add.at(sums[k], self.rows[k], x[samples])
        forth, back = (
            x / np.bincount(rows)[:, np.newaxis] for x, rows in zip(sums, self.rows, strict=True)
        )
        return np.stack([forth + back, forth - back]) / 2


def pairs_of(motion: Motion, stroke: Numbers, axis: int, unit: str) -> Pairs:
    """Return the usable pairs of a recording.

    Parameters
    ----------
    stroke : ndarray, shape (n_used,)
        Number of the stroke of each filtered sample, even forth, odd back; -1 between strokes.
    axis : int
        Moving axis, from 0.
    unit : str
        Unit of the positions.

    Raises
    ------
    NotEnoughData
        No pair is usable.
    """
    q, qd = (x[:: motion.rates.coarse][: len(motion.tau), axis] for x in (motion.q, motion.qd))
    number, returns = np.divmod(stroke, 2)
    steady = motion.used & (motion.slowest[:, axis] >= SLOW) & (stroke >= 0)
    steady &= np.sign(qd) == np.where(returns, -1, 1)
    # bins of about as many samples each, as narrow as the usual stroke fills
    bins, lengths = np.zeros(len(q), dtype=np.intp), np.bincount(stroke[steady])
    if steady.any():
        n = int(np.clip(np.median(lengths[lengths > 0]) // COARSE, *BINS))
        edges = np.unique(np.quantile(q[steady], np.linspace(0.0, 1.0, n + 1)))
        bins = np.clip(np.searchsorted(edges, q, side="right") - 1, 0, len(edges) - 2)
    # one row for each bin passed by both strokes of a pair
    key = number.astype(np.intp) * BINS[1] + bins
    useless, used = [], steady.copy()
    for pair in range((int(stroke.max(initial=-1)) + 1) // 2):
        own = steady & (number == pair)
        reason = _reason(q, qd, own & (returns == 0), own & (returns == 1), bins, unit)
        if reason:
            useless.append(f"pair {pair + 1}: {reason}")
            used &= ~own
    forth, back = (np.flatnonzero(used & (returns == k)) for k in (0, 1))
    rows = np.intersect1d(key[forth], key[back])
    forth, back = (each[np.isin(key[each], rows)] for each in (forth, back))
    if not useless and not len(rows):
        raise NotEnoughData(
            "no forward stroke with a backward stroke after it; record at least one pair, or "
            "write kind: free"
        )
    if not len(rows):
        more = len(useless) - 1
        also = f" (and {more} more pair{'s' if more > 1 else ''})" if more else ""
        raise NotEnoughData(f"{useless[0]}{also}")
    ends, begins = forth[::-1], back
    last, first = (np.unique(number[each], return_index=True)[1] for each in (ends, begins))
    return Pairs(
        forth=forth,
        back=back,
        rows=(np.searchsorted(rows, key[forth]), np.searchsorted(rows, key[back])),
        pair=rows // BINS[1],
        bin=rows % BINS[1],
        turning=(ends[last] + begins[first]) / 2,
        useless=tuple(useless),
    )


def _reason(q: Array, qd: Array, forth: Mask, back: Mask, bins: Indices, unit: str) -> str:
    """Return why a pair is rejected, or an empty string."""
    if not (forth.any() and back.any()):
        return (
            "a stroke is too short for the low-pass; record longer strokes, or state a higher"
            " cut_off in the map"
        )
    common = np.intersect1d(bins[forth], bins[back])
    if len(common) < FEWEST:
        there, again = (f"{x.min():.3g} to {x.max():.3g} {unit}" for x in (q[forth], q[back]))
        return (
            f"forward {there}, backward {again}: {len(common)} bins of position in common, at "
            f"least {FEWEST} needed; move both strokes over the same range"
        )
    both = np.isin(bins, common)
    speeds = [float(np.mean(np.abs(qd[each & both]))) for each in (forth, back)]
    if max(speeds) > UNLIKE * min(speeds):
        return (
            f"forward at {speeds[0]:.3g} {unit}/s, backward at {speeds[1]:.3g} {unit}/s, a ratio "
            f"above {UNLIKE:g}: friction at such different speeds does not cancel; move in both "
            "directions at the same speed, or write kind: free"
        )
    return ""


COMMON = ("offset", "asymmetric", *RIPPLE)
"""Terms equal forth and back and in all recordings of an axis: a constant, a term proportional to
the speed, ripple over the motor angle."""


@dataclass(frozen=True, eq=False)
class Halves:
    """Half-sums and half-differences of a recording, over pairs and bins.

    Attributes
    ----------
    axis : int
        Moving axis, from 0.
    rows : ndarray, shape (2, n, 1 + n_known + n_levels)
        Half-sums and half-differences of the torque less that of known rotors, of `known` columns
        and of levels of friction, scaled to variance 1 for samples of variance 1.
    alone : ndarray, shape of `rows`
        `rows` for motion with all other axes at rest, hence without accidental excitation; the
        column of the known rotors, which is no unknown, is 0.
    q : ndarray, shape (n, n_joints)
        Mean positions [rad or m].
    speed : ndarray, shape (n,)
        Mean speed of both strokes [rad/s or m/s].
    samples : ndarray
        Inner products of the columns of `rows` over all samples of the pairs.
    whole : ndarray, shape (n_pairs, m, m)
        Inner products of the torque, base parameters and `CLASSICAL` friction over all samples of
        each pair, including slow samples.
    also_moving : tuple of int
        Further moving axes, from 0.
    cut_off : float
        Cut-off frequency of the low-pass [Hz].
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
        """Inner products of `rows` and `alone` for half-sums and half-differences, (2, 2, m, m)."""
        return np.stack([np.swapaxes(x, 1, 2) @ x for x in (self.rows, self.alone)])

    def eliminate_levels(self, weights: Array, n: int, *, alone: bool = False) -> Array:
        """Return column combinations, shape (m, n), that eliminate the levels of friction.

        The first `n` columns are kept. Half-sums and half-differences share the levels, so the
        eliminated part depends on the weights of both, shape (2,).
        """
        both = np.tensordot(weights, self._products[int(alone)], 1)
        return np.vstack([np.eye(n), -inverse(both[n:, n:]) @ both[n:, :n]])


def numbered_pairs(recordings: Sequence[Halves]) -> Indices:
    """Number the pairs of the rows consecutively across recordings, from 0."""
    rows = [(k, pair) for k, each in enumerate(recordings) for pair in each.pairs.pair.tolist()]
    return np.unique(rows, axis=0, return_inverse=True)[1].ravel()


def known(robot: Robot) -> tuple[str, ...]:
    """Return the names of the columns common to the recordings of an axis."""
    return (*base_parameters(robot).names, ROTOR, *COMMON)


def halves_of(robot: Robot, motion: FreeMotion, recording: Recording) -> Halves:
    """Condense a recording of an axis moving back and forth.

    Raises
    ------
    NotEnoughData
        No pair is usable.
    """
    (axis,) = motion.moved
    width = bandwidth(*spectrum(recording.q[:, axis], recording.period), recording.period)
    cut_off, reason = cut_off_of([width], recording.period, motion.cut_off)
    none, speed = np.zeros(recording.n_joints), np.ones(recording.n_joints)
    speed[axis] = max(greatest_speed(recording)[axis], SLOWEST)
    processing = Processing(cut_off, cut_off, speed, none.astype(bool), none, none)
    # positions and torque are filtered before columns are computed
    tau = low_passed(recording.tau, recording.period, cut_off)[0]
    filtered = filtered_motion(replace(recording, tau=tau), processing)
    n = len(filtered.tau)
    stroke = recording.stroke[:: filtered.rates.fine * filtered.rates.coarse][:n]
    pairs = pairs_of(filtered, stroke, axis, robot.position_unit(axis))
    named = _columns(robot, filtered, axis)
    velocity = filtered.passed(filtered.qd[:, [axis]], axis)[:n]
    levels = _levels(velocity[:, 0] / processing.speed[axis], pairs)
    base = base_parameters(robot).names
    columns, classical = (
        np.column_stack([named[name] for name in ("torque", *names)])
        for names in (known(robot), (*base, *CLASSICAL))
    )
    columns = np.hstack([columns, levels])
    ways = np.ptp(filtered.q, axis=0)
    # an axis at rest moves by its control deviation. This affects the measured torque, so the
    # columns of the fit keep the motion; the test of the excitation takes the mean position
    # instead, or base parameters would appear excited
    still = ways <= 0.02 * ways[axis]
    at = np.where(still, filtered.q.mean(axis=0), filtered.q)
    qd, qdd = (np.where(still, 0.0, x) for x in (filtered.qd, filtered.qdd))
    alone = columns.copy()
    apart = regressor(robot, at, qd, qdd, joints=[axis])[:, 0]
    alone[:, 1 : 1 + len(base)] = replace(filtered, q=at, qd=qd, qdd=qdd).passed(apart, axis)[:n]
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
        cut_off=cut_off,
        cut_off_reason=reason,
    )


def _columns(robot: Robot, motion: Motion, axis: int) -> dict[str, Array]:
    """Return filtered columns by name: torque without rotors, friction per unit of velocity."""
    rows = regressor(robot, motion.q, motion.qd, motion.qdd, [axis])[:, 0]
    columns = motion.passed(axis_columns(robot, motion, axis, rows, np.zeros(rows.shape[1])), axis)
    names = (*shared_names(robot), ROTOR, *COLUMNS)
    named = dict(zip(names, columns[: len(motion.tau)].T, strict=True))
    for name in ("viscous", "asymmetric"):
        named[name] = named[name] * motion.processing.speed[axis]
    for order in set(RIPPLE_ORDERS).difference(ripple_orders(robot, axis)):
        named[f"cosine {order}"] = named[f"sine {order}"] = np.zeros(len(motion.tau))
    return {**named, "torque": motion.tau[:, axis] - named[ROTOR]}


def _levels(u: Array, pairs: Pairs) -> Array:
    """Return friction columns, shape (n, n_columns), over the relative velocity.

    The columns may be linearly dependent.
    """
    knots: list[float] = []
    # the friction curve has at most as many interpolation speeds as a recording has bins of
    # position (`hil.estimation.back_and_forth.halves.BINS`)
    for speed in np.quantile(np.abs(u[pairs.used]), np.linspace(0.0, 1.0, 8)).tolist():
        # a finer resolution than half of the bend of friction is not needed
        if not knots or speed >= knots[-1] + BEND / 2:
            knots.append(speed)
    curve = np.column_stack([np.interp(np.abs(u), knots, unit) for unit in np.eye(len(knots))])
    steady = np.ones((len(u), 1))
    if len(pairs) > 1:
        steady = make_interp_spline(pairs.turning, np.eye(len(pairs)), k=1)(np.arange(len(u)))
    direction, u = np.sign(u)[:, np.newaxis], u[:, np.newaxis]
    return np.hstack([direction * curve, direction * steady, u * steady])
