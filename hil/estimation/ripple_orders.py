"""Torque ripple of orders that the regression does not hold.

The regression holds the first six multiples of the motor's angle theta. Further orders n are looked
for in what it leaves of each axis: cos n theta and sin n theta, smoothed like everything else and
with friction of each measurement projected out, are fitted to the residuals order by order. An
order counts if noise would hardly explain as much (chi-square of two degrees of freedom), all
orders and axes that are looked at being counted (Bonferroni).

Fast motion hides ripple, because the window passes none of it. What it does pass is a share of the
residual variance, and to first order changes the base parameters by

    N^-1 sum over samples of w X' Z a,

with N the information, Z the smoothed columns and a their amplitudes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.regression.least_squares import fitted, orthonormal
from hil.regression.terms import RIPPLE_ORDERS, multiples, place
from hil.regression.thinned import smoothed_at
from hil.regression.window import half_window

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

ORDERS = range(RIPPLE_ORDERS[-1] + 1, 25)
"""That are looked for: higher ones pass the window only where axes creep."""
CHANCE = 1e-3
"""Probability of a single false order among all axes."""


class UnmodelledRipple(NamedTuple):
    """What was found.

    Attributes
    ----------
    largest : dict
        Order and amplitude at the joint [N m] of the largest, by the index of its axis.
    share : ndarray, shape (n_joints,)
        Of each axis's residual variance.
    change : ndarray, shape (n_base,)
        Of the base parameters.
    """

    largest: dict[int, tuple[int, float]]
    share: Array
    change: Array


def unmodelled_ripple(robot: Robot, fit: SimultaneousFit) -> UnmodelledRipple:
    """Look for ripple of further orders in the measurements of a fit."""
    side, share = np.zeros(len(fit.information)), np.zeros(robot.n_joints)
    solution, largest = fit.solution, {}
    for axis in range(robot.n_joints):
        own = [(s, each) for s, stacked in fit.stacked for each in stacked if each.axis == axis]
        if not own:
            continue
        columns = [_columns(robot, s, each) for s, each in own]
        residuals = [each.torques[:, 0] - each.X @ solution[place(robot, axis)] for _, each in own]
        allowed = CHANCE / (robot.n_joints * len(ORDERS))
        found, a = _orders(np.concatenate(columns), np.concatenate(residuals), allowed)
        if not found.size:
            continue
        sizes = np.linalg.norm(a, axis=1)
        largest[axis] = ORDERS[found[sizes.argmax()]], float(sizes.max())
        ripple = [Z[:, found].real @ a[:, 0] + Z[:, found].imag @ a[:, 1] for Z in columns]
        used = sum(len(r) for r in ripple)
        share[axis] = min(1.0, fit.weight[axis] * sum(r @ r for r in ripple) / used)
        side[place(robot, axis)] += fit.weight[axis] * sum(
            each.each * each.X.T @ r for (_, each), r in zip(own, ripple, strict=True)
        )
    return UnmodelledRipple(largest, share, (fit.noise_covariance @ side)[: fit.n_base])


def _columns(robot: Robot, s: Signals, each: Stacked) -> NDArray[np.complex128]:
    """Z of one measurement, shape (n, n_orders): cosines, and sines as imaginary parts."""
    reach = half_window(s.period)
    own = slice(each.index[0] - reach, each.index[-1] + reach + 1)
    angle = robot.gear_ratio[each.axis] * s.q[own, each.axis]
    columns = smoothed_at(each.index - own.start, multiples(angle, ORDERS).T, s.period)
    free, _ = orthonormal(each.friction)
    left: NDArray[np.complex128] = columns - free @ (free.T @ columns)
    return left


def _orders(columns: Array, residual: Array, chance: float) -> tuple[NDArray[np.intp], Array]:
    """Orders found on an axis, by their places, and their amplitudes [N m], shape (n, 2)."""
    a = np.empty((len(ORDERS), 2))
    explained = np.empty(len(ORDERS))
    for k, Z in enumerate(columns.T):
        both = np.column_stack([Z.real, Z.imag])
        a[k] = fitted(both, residual)
        explained[k] = np.sum((both @ a[k]) ** 2)
    # exp(-x / 2) is the probability of a chi-square above x
    found = np.flatnonzero(explained > -2 * np.log(chance) * np.mean(residual**2))
    return found, a[found]
