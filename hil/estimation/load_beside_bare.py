"""A load from a short run beside a whole one without it: both in one least-squares problem.

The short run need not identify the base parameters. Its measurements enter with p + K phi for p and
offsets of their own (`hil.planning.design.load.embedding`); what gears lag, give way and turn into
friction is taken from the run without the load. Friction is fitted anew in every measurement, of
either run. Standard errors come from what differs between measurements, of which few carry phi, so
that their scores are corrected for the solution's having come to meet them; leaving out one at a
time gave intervals 1.3 to 2 times as wide as need be. Errors of torque constants and rotor inertias
are the same in both runs, and enter by what they do to phi.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.condensed import stack
from hil.estimation.load_misfit import load_misfit
from hil.least_squares.solving import solved, undetermined_beside
from hil.least_squares.terms import n_unknowns, place
from hil.least_squares.uncertainty import bias_reduced
from hil.model.base_parameters import base_parameters
from hil.planning.design.load import embedding

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Condensed, Stacked
    from hil.estimation.load_misfit import AxisMisfit
    from hil.estimation.signals import Signals
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Array = NDArray[np.float64]
    Prepared = Sequence[tuple[ParameterMotion, Signals]]


class FittedLoad(NamedTuple):
    """Free parameters of a load beside the base parameters without it.

    Attributes
    ----------
    p : ndarray, shape (n_base,)
        Without the load, by both runs.
    phi : ndarray, shape (n_free,)
    scatter, drives : ndarray, shape (n_free, n_free)
        Covariance by what differs between measurements; by torque constants and rotor inertias.
    degrees : ndarray, shape (n_free,)
    lost : ndarray, shape (n_free,)
        Whether the measurements leave it open.
    information : ndarray, shape (n_z, n_z)
        About all unknowns z.
    misfit : tuple of AxisMisfit
        What a rigid load leaves unexplained, axis by axis.
    """

    p: Array
    phi: Array
    scatter: Array
    drives: Array
    degrees: Array
    lost: NDArray[np.bool_]
    information: Array
    misfit: tuple[AxisMisfit, ...]


def fit_beside(
    robot: Robot,
    bare: SimultaneousFit,
    loaded: Prepared,
    shown: Array,
    known: Array | None = None,
) -> FittedLoad:
    """Find a load by its own measurements and those without it.

    Parameters
    ----------
    bare : SimultaneousFit
        Of the run without the load.
    loaded : sequence of (ParameterMotion, Signals)
        With it; the drive train found without it taken into account.
    shown : ndarray, shape (n_base, n_free)
        Change of the base parameters by each free parameter.
    known : ndarray, shape (n_base,), optional
        Change of the base parameters by what is known of the load.
    """
    p = bare.solve() + (0.0 if known is None else known)
    found = _fitted(robot, bare, _condensed(robot, bare, loaded, p), shown, known)
    p = found.p + shown @ found.phi + (0.0 if known is None else known)
    return _fitted(robot, bare, _condensed(robot, bare, loaded, p), shown, known)


def _condensed(
    robot: Robot, bare: SimultaneousFit, loaded: Prepared, p: Array
) -> list[list[Condensed]]:
    """Measurements with the load; friction of the transmitted torque where the bare run has it."""

    def of_axis(each: Stacked) -> Condensed:
        return (each.loaded(each.load(p)) if bare.loaded[each.axis] else each).condensed()

    stacks = (axes for motion, s in loaded for axes in stack(robot, motion, s))
    return [[of_axis(each) for each in axes] for axes in stacks]


def _fitted(
    robot: Robot,
    bare: SimultaneousFit,
    items: Sequence[Sequence[Condensed]],
    shown: Array,
    known: Array | None,
) -> FittedLoad:
    n, n_base = n_unknowns(robot), len(base_parameters(robot))
    E, still = embedding(robot, shown), np.zeros(n)
    if known is not None:
        still[:n_base] = known
    own = np.eye(n, E.shape[1])
    pieces = [(each, own, 0.0 * still) for each in bare.items]
    pieces += [(each, E, still) for each in items]
    shares, sides, drives = zip(*(_share(robot, bare.weight, *piece) for piece in pieces),
                                strict=True)  # fmt: skip
    solution = bias_reduced(np.array(shares), np.array(sides))
    N, load = np.sum(shares, axis=0), slice(n, n + shown.shape[1])
    carried = (solved(N, np.sum(drives, axis=0)) * robot.stated_uncertainty)[load]
    return FittedLoad(
        p=solution.x[:n_base],
        phi=solution.x[load],
        scatter=solution.covariance[load, load],
        drives=carried @ carried.T,
        degrees=solution.degrees_of_freedom[load],
        lost=_lost(N, load),
        information=N,
        misfit=load_misfit(
            robot, n_base, (bare.items, solution.x[:n]), (items, E @ solution.x + still)
        ),
    )


def _share(
    robot: Robot, weight: Array, items: Sequence[Condensed], E: Array, still: Array
) -> tuple[Array, Array, Array]:
    """Information, right-hand side, and what drives' errors do to it, of one measurement."""
    N = np.zeros((E.shape[1], E.shape[1]))
    v, drives = np.zeros(len(N)), np.zeros((len(N), 2 * robot.n_joints))
    for item in items:
        rows, w = E[place(robot, item.axis)], weight[item.axis]
        fixed = still[place(robot, item.axis)]
        N += w * rows.T @ item.information @ rows
        v += w * rows.T @ (item.vector - item.information @ fixed)
        drives[:, item.axis] += w * rows.T @ (item.vector + item.motor)
        drives[:, robot.n_joints + item.axis] -= w * rows.T @ item.motor
    return N, v, drives


def _lost(N: Array, load: slice) -> NDArray[np.bool_]:
    """Which of the load's parameters the measurements leave open."""
    at = np.arange(len(N))
    order = np.concatenate([at[load], np.delete(at, at[load])])
    return undetermined_beside(N[np.ix_(order, order)], load.stop - load.start)
