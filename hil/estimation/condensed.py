"""Step 1, improved: a measurement condensed to what it says about all base parameters at once.

The paper's local models (19) and (21) regard one element of M(q) at a time, at one configuration,
and the axes that are not moved as still. Here every usable sample enters with the full row of the
regressor for the measured motion of all joints,

    Q_i - Qm_i = A_i(q, qd, qdd) p + F(t) a + G_i(q) b + e,

and friction is again fitted for this measurement alone; the columns, and which samples are usable,
are those of `hil.friction.equation`. The coefficients `a` are eliminated at once by orthogonal
projection (Frisch-Waugh-Lovell), so nothing about friction passes from one measurement to the next.

It makes no difference what the measurement was made for: strokes of one axis, an axis that creeps
while another one accelerates, a trajectory of all axes. A trajectory goes on for minutes, in which
friction changes, so each of its periods counts as a measurement of its own.

What is left of thousands of samples is a small information matrix and vector over p and b, which
step 2 adds up: least squares over all samples of the campaign, without ever stacking them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.friction.equation import COMMON, FEWEST, LOAD
from hil.least_squares.blocks import Blocks
from hil.least_squares.differences import rounding_window
from hil.least_squares.solving import eliminated
from hil.least_squares.thinned import window_means
from hil.least_squares.window import APART
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
"""Every n-th used sample says how much an error of acceleration matters there: one in 0.1 s."""
ROTOR = "known rotor"
"""Column of the torque of rotors of known inertia."""


class Condensed(NamedTuple):
    """What the torque of one axis in one measurement says, friction eliminated.

    Attributes
    ----------
    product : ndarray, shape (k + n_base + N_COMMON, k + n_base + N_COMMON)
        Inner products of all columns: the left-hand sides; X, base parameters and common terms.
    n : int
        Samples less eliminated coefficients.
    """

    product: Array
    n: int


@dataclass(frozen=True, slots=True, eq=False)
class Stacked:
    """Columns of one axis in one measurement, smoothed, samples `APART`.

    Attributes
    ----------
    axis : int
        Index from 0.
    n_base : int
    torques : ndarray, shape (n, k)
        Left-hand sides, such as y and the motor's part.
    X : ndarray, shape (n, n_base + N_COMMON)
    friction : ndarray, shape (n, n_friction)
    each : int
        Samples for which each of these stands.
    index : ndarray, shape (n,)
        Of the samples in the measurement's signals.
    time : float
        Mean of the samples' [s].
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
        """The same with the columns of load-dependent friction.

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
        """Absolute value of the torque that base parameters `p` say is transmitted, shape (n,).

        It is smoothed before its absolute value is taken, which would make friction of the noise.
        """
        load: Array = np.abs(self.X[:, : self.n_base] @ p)
        return load

    def condensed(self) -> Condensed:
        """Inner products of torques and X, friction eliminated."""
        columns = np.hstack([self.torques, self.X, self.friction])
        product, rank = eliminated(columns.T @ columns, self.friction.shape[1])
        return Condensed(self.each * product, self.each * len(columns) - rank)


def condensed_blocks(
    robot: Robot,
    stacks: Iterable[Sequence[Stacked]],
    shifts: Sequence[str] = (),
    gears: Sequence[str] = (),
) -> Blocks:
    """Condense measurements, each a group; columns of rotors are shared, too.

    Parameters
    ----------
    stacks : iterable of sequence of Stacked
        Of each measurement, the axes that move.
    shifts, gears : sequence of str
        Columns that stand behind the motor's part, and behind the base parameters.
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
    """Torque as it was read, and that of the known rotor, which is off it: rows over the columns.

    Parameters
    ----------
    blocks : Blocks
        Of the torque less that of the rotor, which is a column, `ROTOR`.
    """
    m, rotor = blocks.products.shape[-1], blocks.place(ROTOR)
    taken: Array = -np.eye(1, m, int(rotor[0]))
    return np.eye(1, m) - taken, taken


def stack(robot: Robot, measurement: ParameterMotion, s: Signals) -> list[list[Stacked]]:
    """Stack y, the motor's part and X: of each period or measurement, each axis that moves.

    What holds too few usable samples is left out.
    """
    motors = motor_torque(robot, s.q, s.qd, s.qdd)

    def part(axis: int) -> tuple[Array, Mask]:
        torques = np.column_stack([s.tau[:, axis] - motors[:, axis], motors[:, axis]])
        return torques, s.usable(robot, axis)

    return stack_axes(robot, s, measurement.moved, part)


def of_steps(
    robot: Robot, axis: int, p: Array, stacked: Sequence[tuple[Signals, Stacked]]
) -> Array:
    """What the step of each encoder adds to X'y of an axis less X'X p, on average.

    A position that is read in steps d errs by d^2 / 12 (variance), from sample to sample anew, and
    differences and window make an error of the acceleration of it. All that an acceleration is
    multiplied by errs with it, and inertias come out too small, unless what that adds is taken off
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
    variance = np.concatenate([_variance_of_steps(robot, s, each) for s, each in stacked])
    still = np.zeros(robot.n_joints)
    rates = [(still, still), *((still, unit) for unit in np.eye(robot.n_joints))]
    weight, *moved = (A[:, 0] for A in regressors(robot, q, rates, [axis]))
    for joint, A in enumerate(moved):
        inertia = A - weight
        torque = inertia @ p + robot.reflected_inertia[axis] * (joint == axis)
        found[:, joint] = -inertia.T @ (variance[:, joint] * torque)
    return found


def _variance_of_steps(robot: Robot, s: Signals, stacked: Stacked) -> Array:
    """Variance of accelerations, of every n-th sample for all that it stands for, (n, n_joints)."""
    n = len(stacked.index[::SPARSE])
    variance = np.broadcast_to(s.resolution, robot.n_joints) ** 2 / 12
    variance = variance * np.sum(rounding_window(s.period) ** 2)
    return np.tile(stacked.each * len(stacked.index) / n * variance, (n, 1))


def stack_axes(
    robot: Robot,
    s: Signals,
    axes: Iterable[int],
    part: Callable[[int], tuple[Array, Mask]],
    passes: int = 1,
) -> list[list[Stacked]]:
    """Stack axes: of each period or measurement those with enough usable samples.

    Parameters
    ----------
    part : callable
        Of an axis, its left-hand sides and the samples that are usable, as of `stack_axis`.
    """
    periods = list(groups(s))
    found: list[list[Stacked]] = [[] for _ in periods]
    for axis in axes:
        for place, mine in enumerate(stack_axis(robot, s, axis, *part(axis), periods, passes)):
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
) -> Iterator[Stacked | None]:
    """Stack one axis: of each of `periods` its `used` samples, or None if they are too few.

    Parameters
    ----------
    torques : ndarray, shape (n, k)
        Not smoothed yet.
    used : ndarray of bool, shape (n,)
        Further from both ends than smoothing reaches.
    periods : list of ndarray of bool, shape (n,)
    passes : int
        How often all columns are smoothed.
    """
    each = max(1, round(APART / s.period))
    if used.sum() < FEWEST:
        yield from (None for _ in periods)
        return
    rows, common, friction = s.terms(robot, axis)
    for period in periods:
        index = np.flatnonzero(used & period)[::each]
        if len(index) * each < FEWEST:
            yield None
            continue
        means, time = (
            window_means(index, len(s.time), s.period, passes),
            float(s.time[index].mean()),
        )
        y, A, G, F = (np.asarray(means @ x) for x in (torques, rows, common, friction))
        yield Stacked(axis, A.shape[1], y, np.hstack([A, G]), F, each, index, time)


def groups(s: Signals) -> Iterator[Mask]:
    """Samples that share their friction, group by group; all where there are no groups."""
    if s.group is None:
        yield np.ones(len(s.time), dtype=bool)
    else:
        yield from (s.group == number for number in range(int(s.group.max()) + 1))
