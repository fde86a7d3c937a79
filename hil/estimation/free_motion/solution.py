"""Solve the weighted regression of free motions by one of several solvers.

least squares
    without constraints;
positive
    least squares, and if the mass matrix is then not positive anywhere on the motion, the nearest
    solution with a positive mass matrix (`hil.estimation.free_motion.positive`), unless the torques
    contradict that solution; the covariance includes the results of other friction laws
    (`hil.estimation.free_motion.choice`), and friction offsets that resemble weight
    (`hil.estimation.free_motion.offsets`); friction is fitted to all samples, including slow ones;
instrumental
    Z'W x = Z'y: Z from every second sample, W from the other samples. Measurement errors that are
    independent from sample to sample are in Z or in W only, so they cause no bias;
a function of the equations of pieces of time
    the equations with the weights of this function, and their solution.

Covariances contain the scatter over time and over states (`hil.least_squares.regression`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.free_motion.choice import MATERIAL, covariance_of_choices
from hil.estimation.free_motion.offsets import (
    enlarge_covariance,
    only_directions,
    split_covariance,
    weight_in_offset,
)
from hil.estimation.free_motion.positive import nearest_positive
from hil.estimation.options import DEFAULTS
from hil.estimation.prior import least_unknowns, open_covariance
from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression, Solver
from hil.least_squares.solving import RANK, condition, inverse, solved, undetermined
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.options import Options
    from hil.estimation.prior import Prior
    from hil.least_squares.regression import Covariance, Fit
    from hil.model.base_parameters import BaseParameters
    from hil.model.robot import Robot

FreeSolver = Literal["least squares", "positive", "instrumental"] | Solver
BLOCKS = 30
"""Maximum number of blocks of time, low enough to include disturbances longer than a piece."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Estimated unknowns with covariance, and the correction for a positive mass matrix.

    Attributes
    ----------
    moved : float
        Largest change of an unknown by the correction, over its standard error.
    possible : bool
        True if the corrected unknowns are used; False if the torques contradict them.
    unusual : tuple of int
        Axes, from 0, whose offset exceeds usual offsets of friction, and resembles gravity.
    prior_share : ndarray, shape (n_base,), optional
        See `Estimate`.
    lost : tuple of int
        Base parameters, from 0, without data, because axes are at rest.
    """

    fit: Fit
    moved: float = 0.0
    possible: bool = True
    unusual: tuple[int, ...] = ()
    prior_share: Array | None = None
    lost: tuple[int, ...] = ()


def solve(
    robot: Robot,
    products: Products,
    choice: Choice,
    solver: FreeSolver,
    configurations: Array,
    still: Sequence[int] = (),
    options: Options = DEFAULTS,
    noise: Array | None = None,
    *,
    silent: bool = False,
) -> Solution:
    """Solve for the unknowns of base parameters and friction.

    Parameters
    ----------
    configurations : ndarray, shape (n, n_joints)
        Configurations of the motion where the mass matrix must be positive.
    still : sequence of int
        Axes at rest, from 0.
    options : Options
        Covariance rule, and a prior for parameters not excited by the motion.
    noise : ndarray, shape (n_base, n_directions), optional
        Combinations of base parameters determined by noise of the positions.
    silent : bool
        True if brakes hide torques at rest: parameters without data are then left out of the model
        unless it explains less without them.

    Raises
    ------
    NotIdentifiable
        No axis moves, or moving axes do not excite base parameters that no prior states.
    """
    pieces = asked = choice.fitted(products)
    if len(still) == robot.n_joints:
        raise NotIdentifiable(
            "no axis moves in the recordings: no position leaves the noise band of its encoder; "
            "add recordings in which the joints move, or name other columns of positions"
        )
    if options.prior is None and not silent:
        require_determined(robot, pieces, still)
    if callable(solver):
        asked = replace(pieces, solver=solver)
    elif solver == "instrumental" and products.instruments is not None:
        asked = pieces.transfer(products.instruments)
    # other rules need weighted, symmetric equations, which the remaining solvers lack
    rule: Covariance = options.covariance if solver == "positive" else "jackknife"
    fit = asked.fit(rule, products.cells[choice.slowest], BLOCKS)
    covariance = fit.covariance
    covariance += split_covariance(only_directions(products.ways), fit.layout, fit.x)
    fit = replace(fit, covariance=covariance, condition=condition(pieces.normal.information))
    # no weight: torque 0 throughout, so the friction of such an axis is in no equation so far
    mute = (choice.weights == 0) & ~np.isin(np.arange(robot.n_joints), still)
    if solver == "positive":
        fit = replace(fit, covariance=covariance + covariance_of_choices(products, choice))
        found = settled(robot, pieces, fit, configurations, options.prior, still, noise)
        refitted = np.flatnonzero(mute | (choice.slowest > 0))
    else:
        found = settled(robot, pieces, fit, None, options.prior, still, noise)
        refitted = np.flatnonzero(mute)
    if silent and options.prior is None:
        before, after = (pieces.blocks.mean_squares(x) for x in (fit.x, found.fit.x))
        if np.any(after > (1.0 + MATERIAL) ** 2 * before):
            require_determined(robot, pieces, still)
    if not len(refitted):
        return found
    return replace(found, fit=refit_friction(products, found.fit, options.covariance, refitted))


def settled(
    robot: Robot,
    pieces: Regression,
    fit: Fit,
    configurations: Array | None,
    prior: Prior | None,
    still: Sequence[int] = (),
    noise: Array | None = None,
) -> Solution:
    """Complete a fit by a prior, errors of unusual offsets, and a positive mass matrix."""
    share, n, (N, torque) = None, len(base_parameters(robot)), _torque_shares(pieces, still)
    if noise is not None and noise.size:
        # without the information on these combinations, and the friction that goes with them
        side = N @ np.vstack([noise, -inverse(N[n:, n:]) @ N[n:, :n] @ noise])
        N = N - side @ np.linalg.solve(side[:n].T @ noise, side.T)
    wide = open_covariance(robot, N, torque)
    lost = np.flatnonzero(np.diag(wide)[:n])
    if prior is None and len(lost):
        T = embedded(least_unknowns(robot, N, torque), fit.kept, len(fit.x))
        fit = replace(fit, x=T @ fit.x, covariance=T @ fit.covariance @ T.T)
    wide = embedded(wide, fit.kept, len(fit.x))
    if prior is None:
        fit = replace(fit, covariance=fit.covariance + wide)
    else:
        fit, share = _completed(robot, pieces, fit, prior)
        # a prior states bodies, no springs and rotors
        lost = lost[~prior.predict(robot)[1][lost].any(axis=1)]
    if len(lost) == n:  # combinations of all: as many names as there are combinations
        lost = lost[_independent(wide[np.ix_(fit.kept[lost], fit.kept[lost])])]
    if configurations is None:
        return Solution(fit, prior_share=share, lost=tuple(lost.tolist()))
    # The move minimises the increase of the torque residuals: its metric is that of the normal
    # equations. If a residual grows by more than `MATERIAL` on any axis, the model has another
    # error, and the parameters stay unchanged.
    metric = embedded(inverse(pieces.normal.information), fit.kept, len(fit.x)) + wide
    covariance, unusual = enlarge_covariance(
        fit.x, fit.covariance, metric, fit.layout, fit.degrees_of_freedom, weight_in_offset(robot)
    )
    nearest = nearest_positive(robot, fit.x, metric, configurations)
    error = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
    moved = float(np.abs((nearest - fit.x) / error)[fit.kept].max(initial=0.0))
    before, after = (pieces.blocks.mean_squares(x) for x in (fit.x, nearest))
    possible = bool(np.all(after <= (1.0 + MATERIAL) ** 2 * before))
    fit = replace(fit, x=nearest if possible else fit.x, covariance=covariance)
    return Solution(fit, moved, possible, tuple(unusual), share, tuple(lost.tolist()))


def _torque_shares(pieces: Regression, still: Sequence[int]) -> tuple[Array, Array]:
    """Return normal equations in shares of the axes' squared torques, and the rms torques.

    Noise and friction cause errors of the torque of at least the same share on every axis, so these
    shares decide what is identified. Rows weighted by residuals do not: with 1 % of noise and a
    ten-thousandth of the torque, a wrist outweighs the base by 10^8. Axes at rest have no torque
    of their own: NaN, like axes without torque.
    """
    blocks, owner = pieces.blocks, pieces.blocks.owner
    squares, counts = blocks.squares, np.maximum(blocks.counts.sum(axis=0), 1.0)
    used = (squares > 0) & (pieces.weights > 0)
    weights = np.where(used, 1.0 / np.where(used, squares, 1.0), 0.0)
    torque = np.full(blocks.layout.n_channels, np.nan)
    for channel in np.flatnonzero(used).tolist():
        level = np.sqrt(squares[channel] / counts[channel])
        torque[owner[channel]] = np.fmax(torque[owner[channel]], level)
    torque[list(still)] = np.nan
    return blocks.total.normal(weights).only(pieces.kept).information, torque


def _independent(covariance: Array) -> Indices:
    """Return the places of as many unknowns as a covariance, shape (n, n), has directions."""
    from scipy.linalg import qr  # noqa: PLC0415 - takes long to load

    error = np.sqrt(np.diag(covariance))
    _, R, order = qr(covariance / np.outer(error, error), pivoting=True)
    size = np.abs(np.diag(R))
    return np.sort(order[size > np.sqrt(RANK) * size[0]])


def refit_friction(products: Products, fit: Fit, covariance: Covariance, axes: Indices) -> Fit:
    """Refit friction to samples of every speed, including the dead zone.

    Errors of a law at low speed resemble weight or inertia, so base parameters come from faster
    samples. But a law describes slow samples best if it is fitted to them, too. On an axis without
    motor, a weighted equation 0 = A p + friction would shrink p by the noise of A; with known p,
    A p is a torque like any other. With fixed shared unknowns x_s and P = N_oo^-1 N_os the own
    unknowns are

        x_o = N_oo^-1 v_o - P x_s,    V_oo = V + P V_ss P',    V_os = -P V_ss,

    with V the scatter of x_o for known x_s. Axes that move in one direction only keep their values:
    offset and Coulomb friction share a column, and slow samples add only noise.

    Parameters
    ----------
    covariance : str
        Rule of `hil.least_squares.regression`.
    axes : ndarray of int
        Axes to refit, from 0.
    """
    layout, k = fit.layout, len(fit.layout.shared)
    axis = (fit.kept - k) // len(layout.own)
    one_way = list(only_directions(products.ways))
    own = fit.kept[np.isin(axis, axes) & ~np.isin(axis, one_way)]
    if not len(own):
        return fit
    m = products.pieces[0].products.shape[-1]
    rest = np.tile(np.concatenate([[1.0], -fit.x[:k], np.zeros(m - 1 - k)]), (products.n_joints, 1))
    left = Regression.weighed(products.pieces[0].recast(rest), own)
    seen = left.fit(covariance, products.cells[0].recast(rest), BLOCKS)
    N = left.blocks.total.normal(left.weights).information
    P = solved(N[np.ix_(own, own)], N[own, :k])
    x, V, degrees = fit.x.copy(), fit.covariance.copy(), fit.degrees_of_freedom.copy()
    V[own] = -P @ V[:k]
    V[:, own] = V[own].T
    V[np.ix_(own, own)] = seen.covariance[np.ix_(own, own)] + P @ V[:k, :k] @ P.T
    x[own], degrees[own] = seen.x[own], seen.degrees_of_freedom[own]
    return replace(fit, x=x, covariance=V, degrees_of_freedom=degrees)


def _completed(robot: Robot, pieces: Regression, fit: Fit, prior: Prior) -> tuple[Fit, Array]:
    """Complete base parameters by a prior, and update the dependent unknowns."""
    N, kept, n = pieces.normal.information, fit.kept, len(base_parameters(robot))
    p, covariance, share = prior.completed(robot, N, fit.x[:n], fit.covariance[:n, :n])
    T = np.zeros((len(fit.x), n))
    T[kept] = np.vstack([np.eye(n), -inverse(N[n:, n:]) @ N[n:, :n]])
    change = covariance - fit.covariance[:n, :n]
    return replace(
        fit, x=fit.x + T @ (p - fit.x[:n]), covariance=fit.covariance + T @ change @ T.T
    ), share


def require_determined(robot: Robot, pieces: Regression, still: Sequence[int]) -> None:
    """Raise an error for base parameters not determined although all axes move.

    Raises
    ------
    NotIdentifiable
    """
    base, N = base_parameters(robot), pieces.normal.information
    lost = _open(N, len(base))
    # a weakly excited combination is not identified, but leaves a model of motions like these
    if not lost or not _open(N, len(base), len(N) * np.finfo(float).eps):
        return
    # base parameters equal to an unknown rotor inertia of a slide, by column
    slides = np.flatnonzero(~robot.revolute).tolist()
    own = {name: k for k, name in enumerate(base.expressions)}
    rotors = {
        own[name]: axis for axis in slides if (name := f"Ia{axis + 1}") in own and own[name] in lost
    }
    rest = [k for k in range(len(N)) if k not in rotors]
    open_ = [rest[k] for k in _open(N[np.ix_(rest, rest)], len(base) - len(rotors))]
    beside = [k for k in lost if k not in open_]
    # With the component g of gravity along a slide of constant direction, the force is m (qdd + g)
    # + Ia qdd + offset: Ia may have any value, with m smaller by Ia and the offset larger by g Ia.
    reasons = [
        f"the rotor inertia of axis {axis + 1} ({base.names[column]}) cannot be distinguished "
        f"from the {_listed(base, [k for k in beside if k != column])}: on a "
        "prismatic axis gravity is a constant force, like the offset of friction. State the "
        f"rotor_inertia of joint {axis + 1} in the robot file (such as robot.yaml in the run "
        "folder), as in drive: {gear_ratio: 1, rotor_inertia: 0, torque_constant: unknown}. With 0 "
        "the mass includes the rotor inertia, and the offset includes the weight; torques stay the "
        "same"
        for column, axis in rotors.items()
    ]
    if len(open_) == len(lost) - len(rotors):
        reasons, open_ = [], lost
    if open_ and not still:
        reasons.append(
            f"the recorded motions do not excite {_listed(base, open_)}; add recordings in which "
            "more joints move through more of their ranges, or state in the robot file which "
            "link parameters are present, or take missing parameters from CAD (hil identify "
            "--prior cad=0.3 --urdf FILE)"
        )
    if reasons:
        raise NotIdentifiable(". ".join(reasons))


def _open(N: Array, n: int, rank: float = RANK) -> list[int]:
    """Return the unknowns among the first `n` that the normal equations do not determine."""
    return np.flatnonzero((undetermined(N, rank) | (np.diag(N) == 0))[:n]).tolist()


def _listed(base: BaseParameters, columns: Sequence[int]) -> str:
    return ", ".join(base.titles[column] for column in columns)
