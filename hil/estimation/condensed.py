"""Condense a measurement to information on the base parameters (step 1, improved).

The paper's local models (19) and (21) treat one element of M(q) at a time, at one configuration,
with resting axes assumed immobile. Here every usable sample enters with the full row of the
regressor for the measured motion of all joints,

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e,

and friction is again fitted to this measurement alone; the columns, and the selection of usable
samples, are those of `hil.friction.equation`. The coefficients `a` are eliminated at once by
orthogonal projection (Frisch-Waugh-Lovell), so no information on friction passes from one
measurement to the next.

The purpose of the measurement does not matter: strokes of one axis, an axis creeping while another
one accelerates, a trajectory of all axes. A trajectory takes minutes, in which friction changes, so
each of its periods counts as a separate measurement.

Thousands of samples are reduced to a small information matrix and vector over p and b, to be summed
in step 2: least squares over all samples of the campaign, without ever stacking the samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.friction.equation import COMMON, FEWEST, LOAD, term_columns
from hil.least_squares.blocks import Blocks
from hil.least_squares.solving import eliminated
from hil.least_squares.window import APART, half_window, rounding_window, widen, window_means
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import regressors
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array, Mask
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion


SPARSE = 8
"""Decimation of the used samples for the effect of acceleration errors: one sample in 0.1 s."""
ROTOR = "known rotor"
"""Name of the column with the torque of rotors of known inertia."""


class Condensed(NamedTuple):
    """Information in the torque of an axis in a measurement, friction eliminated.

    Attributes
    ----------
    product : ndarray, shape (k + n_base + N_COMMON, k + n_base + N_COMMON)
        Inner products of all columns: left-hand sides, base parameters, common terms.
    n : int
        Samples less eliminated coefficients.
    """

    product: Array
    n: int


@dataclass(frozen=True, slots=True, eq=False)
class Stacked:
    """Smoothed columns of an axis in a measurement, one row every `APART` seconds.

    Attributes
    ----------
    axis : int
        Index from 0.
    torques : ndarray, shape (n, k)
        Left-hand sides, such as y and the motor's part.
    X : ndarray, shape (n, n_base + N_COMMON)
    friction : ndarray, shape (n, n_friction)
    each : int
        Number of recorded samples per row.
    index : ndarray, shape (n,)
        Indices of the samples in the measurement's signals.
    time : float
        Mean time of the samples [s].
    """

    axis: int
    n_base: int
    torques: Array
    X: Array
    friction: Array
    each: int
    index: NDArray[np.intp]
    time: float

    def loaded(self, load: Array) -> Stacked:
        """Return a copy with the columns of load-dependent friction.

        Parameters
        ----------
        load : ndarray, shape (n,)
            Absolute value of the transmitted torque, smoothed [N m].
        """
        X = self.X.copy()
        X[:, self.n_base + LOAD] = load * np.sign(self.friction[:, 0])
        X[:, self.n_base + LOAD + 1] = load
        return replace(self, X=X)

    def load(self, p: Array) -> Array:
        """Return the absolute transmitted torque for base parameters `p`, shape (n,).

        Smoothing precedes the absolute value, since rectified noise would look like friction.
        """
        load: Array = np.abs(self.X[:, : self.n_base] @ p)
        return load

    def condensed(self) -> Condensed:
        """Return inner products of torques and X, friction eliminated."""
        columns = np.hstack([self.torques, self.X, self.friction])
        product, rank = eliminated(columns.T @ columns, self.friction.shape[1])
        return Condensed(self.each * product, self.each * len(columns) - rank)


def condensed_blocks(
    robot: Robot,
    stacks: Iterable[Sequence[Stacked]],
    shifts: Sequence[str] = (),
    gears: Sequence[str] = (),
) -> Blocks:
    """Condense measurements to groups, with the rotor column among the shared columns.

    Parameters
    ----------
    stacks : iterable of sequence of Stacked
        Moving axes of each measurement.
    shifts, gears : sequence of str
        Columns following the motor's part, and columns following the base parameters.
    """
    shared, own = (ROTOR, *base_parameters(robot).names, *gears), (*shifts, *COMMON)
    columns = (ROTOR, *shifts, *shared[1:], *COMMON)
    order = [0, *(1 + columns.index(name) for name in (*shared, *own))]
    condensed = [[(each.axis, each.condensed()) for each in axes] for axes in stacks]
    products = np.zeros((len(condensed), robot.n_joints, len(order), len(order)))
    counts = np.zeros(products.shape[:2])
    for group, axes in enumerate(condensed):
        for axis, each in axes:
            products[group, axis] = each.product[np.ix_(order, order)]
            counts[group, axis] = each.n
    return Blocks(shared, own, products, counts)


def drive_torques(blocks: Blocks) -> tuple[Array, Array]:
    """Return recorded torque and known rotor torque as rows over the columns.

    Parameters
    ----------
    blocks : Blocks
        Blocks with the torque less that of the rotor, whose column is `ROTOR`.
    """
    m, rotor = blocks.products.shape[-1], blocks.place(ROTOR)
    taken: Array = -np.eye(1, m, int(rotor[0]))
    return np.eye(1, m) - taken, taken


def stack(
    robot: Robot, measurement: ParameterMotion, s: Signals, thin: Sequence[int] = ()
) -> list[list[Stacked]]:
    """Stack y, the motor's part and X for the moving axes of each period or measurement.

    Axes with too few usable samples are left out. `thin` has an axis's rows per computed row, by
    default 1.
    """
    motors = motor_torque(robot, s.q, s.qd, s.qdd)

    def part(axis: int) -> tuple[Array, Mask]:
        torques = np.column_stack([s.tau[:, axis] - motors[:, axis], motors[:, axis]])
        return torques, s.usable(robot, axis)

    return stack_axes(robot, s, measurement.moved, part, thin=thin)


def rows_used(used: Mask, period: float) -> NDArray[np.intp]:
    """Return the indices of rows among `used` samples; none for too few samples."""
    each = max(1, round(APART / period))
    index = np.flatnonzero(used)[::each]
    return index if len(index) * each >= FEWEST else index[:0]


def thinned(rows: NDArray[np.intp], thin: int) -> NDArray[np.intp]:
    """Return the middle row of every `thin` rows; of at most `thin` rows, every row."""
    return rows[thin // 2 :: thin] if len(rows) > thin else rows


def quantisation_bias(
    robot: Robot, axis: int, p: Array, stacked: Sequence[tuple[Signals, Stacked]]
) -> Array:
    """Return the expected bias of X'y - X'X p of an axis, by encoder quantisation.

    A position with the quantisation step d has an error of variance d^2 / 12, independent from
    sample to sample, turned into an acceleration error by differentiation and window. All columns
    with an acceleration share its error, and inertias are underestimated unless the bias is removed
    (W. A. Fuller, Measurement Error Models, 1987, section 2.2).

    Parameters
    ----------
    stacked : sequence of (Signals, Stacked)
        Measurements of the axis.

    Returns
    -------
    ndarray, shape (n_base, n_joints)
    """
    found = np.zeros((len(p), robot.n_joints))
    if not stacked:
        return found
    q = np.concatenate([s.q[each.index[::SPARSE]] for s, each in stacked])
    variances = []
    for s, each in stacked:
        n = len(each.index[::SPARSE])
        step = s.resolution**2 / 12
        # of an acceleration; the decimated samples stand for all recorded ones
        step = step * np.sum(rounding_window(s.period) ** 2)
        variances.append(np.tile(each.each * len(each.index) / n * step, (n, 1)))
    variance = np.concatenate(variances)
    still = np.zeros(robot.n_joints)
    rates = [(still, still), *((still, unit) for unit in np.eye(robot.n_joints))]
    weight, *moved = (A[:, 0] for A in regressors(robot, q, rates, [axis]))
    for joint, A in enumerate(moved):
        inertia = A - weight
        torque = inertia @ p + robot.reflected_inertia[axis] * (joint == axis)
        found[:, joint] = -inertia.T @ (variance[:, joint] * torque)
    return found


def stack_axes(
    robot: Robot,
    s: Signals,
    axes: Iterable[int],
    part: Callable[[int], tuple[Array, Mask]],
    passes: int = 1,
    thin: Sequence[int] = (),
) -> list[list[Stacked]]:
    """Stack axes with enough usable samples, by period or measurement.

    Parameters
    ----------
    part : callable
        Function from an axis to `torques` and `used` of `stack_axis`.
    thin : sequence of int
        See `stack`.
    """
    periods = list(groups(s))
    found: list[list[Stacked]] = [[] for _ in periods]
    for axis in axes:
        every = thin[axis] if thin else 1
        stacked = stack_axis(robot, s, axis, *part(axis), periods, passes, every)
        for place, mine in enumerate(stacked):
            if mine is not None:
                found[place].append(mine)
    return [each for each in found if each]


def stack_axis(
    robot: Robot,
    s: Signals,
    axis: int,
    torques: Array,
    used: Mask,
    periods: list[Mask],
    passes: int = 1,
    thin: int = 1,
) -> Iterator[Stacked | None]:
    """Stack the `used` samples of an axis in each of `periods`, or None for too few.

    Parameters
    ----------
    torques : ndarray, shape (n, k)
        Unsmoothed torques.
    used : ndarray of bool, shape (n,)
        Usable samples; none so close to an end that smoothing would reach past it.
    periods : list of ndarray of bool, shape (n,)
    passes : int
        Number of smoothing passes.
    thin : int
        Number of rows per computed row.
    """
    rows = [thinned(rows_used(used & period, s.period), thin) for period in periods]
    if used.sum() < FEWEST or not any(map(len, rows)):
        yield from (None for _ in periods)
        return
    near = np.arange(len(s.time))
    if thin == 1:
        columns = torques, *s.terms(robot, axis)
    else:
        wanted = np.isin(near, np.concatenate(rows))
        near = np.flatnonzero(widen(wanted, passes * half_window(s.period)))
        columns = torques[near], *term_columns(robot, s, axis, at=near)
    for index in rows:
        if not len(index):
            yield None
            continue
        means = window_means(np.searchsorted(near, index), len(near), s.period, passes)
        y, A, G, F = (np.asarray(means @ x) for x in columns)
        each, time = max(1, round(APART / s.period)), float(s.time[index].mean())
        yield Stacked(axis, A.shape[1], y, np.hstack([A, G]), F, each, index, time)


def groups(s: Signals) -> Iterator[Mask]:
    """Yield masks of samples with common friction; a single mask without groups."""
    if s.group is None:
        yield np.ones(len(s.time), dtype=bool)
    else:
        yield from (s.group == number for number in range(int(s.group.max()) + 1))
