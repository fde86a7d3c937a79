"""Detect torque ripple of orders outside the regression.

The regression contains the first six multiples of the motor angle theta. Further orders n are
searched for in the residuals of each axis: cos n theta and sin n theta, smoothed like all signals
and with friction of each measurement projected out, are fitted to the residuals measurement by
measurement. The phase differs between measurements: the servo compensates a part of the ripple,
depending on the speed. Most orders explain only noise, as any two columns do, so the median over
orders is the noise level; the order with the largest explained part counts if noise is an unlikely
cause (chi-square with two degrees of freedom a measurement), corrected for the number of tested
orders and axes (Bonferroni). Then the next order is searched for in the remainder.

Fast motion hides ripple, because the window filters it out. The remaining ripple is a share of the
residual variance, and to first order changes the base parameters by

    N^-1 sum over samples of w X' r,

with N the information and r the ripple.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.friction.equation import place
from hil.friction.ripple import RIPPLE_ORDERS, multiples
from hil.least_squares.solving import orthonormal, project_out
from hil.least_squares.window import half_window, smooth_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.condensed import Stacked
    from hil.estimation.signals import Signals
    from hil.estimation.simultaneous import SimultaneousFit
    from hil.model.robot import Robot


ORDERS = range(RIPPLE_ORDERS[-1] + 1, 25)
"""Tested orders; the window suppresses higher orders except on creeping axes."""


class UnmodelledRipple(NamedTuple):
    """Detected ripple outside the regression.

    Attributes
    ----------
    largest : dict
        Order and amplitude at the joint [N m] of the strongest ripple, by index of the axis.
    share : ndarray, shape (n_joints,)
        Share of each axis's residual variance.
    change : ndarray, shape (n_base,)
        Change of the base parameters.
    """

    largest: dict[int, tuple[int, float]]
    share: Array
    change: Array


def unmodelled_ripple(robot: Robot, fit: SimultaneousFit) -> UnmodelledRipple:
    """Detect ripple of further orders in the measurements of a fit."""
    side, share = np.zeros(len(fit.information)), np.zeros(robot.n_joints)
    solution, largest = fit.solution, {}
    for axis in range(robot.n_joints):
        own = [(s, each) for s, stacked in fit.stacked for each in stacked if each.axis == axis]
        if not own:
            continue
        pieces = [_piece(robot, s, each, solution) for s, each in own]
        # probability of a single false order among all axes
        orders, ripple = _found(pieces, 1e-3 / (robot.n_joints * len(ORDERS)))
        if not orders:
            continue
        largest[axis] = next(iter(orders.items()))
        used = sum(len(r) for r in ripple)
        share[axis] = min(1.0, fit.weight[axis] * sum(r @ r for r in ripple) / used)
        side[place(robot, axis)] += fit.weight[axis] * sum(
            each.each * each.X.T @ r for (_, each), r in zip(own, ripple, strict=True)
        )
    return UnmodelledRipple(largest, share, (fit.noise_covariance @ side)[: fit.n_base])


class _Piece(NamedTuple):
    """Cosines (sines as imaginary parts) of an axis, and residual torque [N m], less friction."""

    columns: NDArray[np.complex128]
    residual: Array

    def explained(self, residual: Array) -> tuple[Array, Array]:
        """Return explained squares of a residual by order, and squares of a unit amplitude."""
        c, s = self.columns.real, self.columns.imag
        cc, ss, cs = (np.einsum("nk,nk->k", *pair) for pair in ((c, c), (s, s), (c, s)))
        on_c, on_s = residual @ c, residual @ s
        apart = cc * ss - cs**2
        square = ss * on_c**2 - 2 * cs * on_c * on_s + cc * on_s**2
        # smallest independent share of a cosine and a sine
        clear = apart > 1e-6 * cc * ss
        return np.divide(square, apart, out=np.zeros_like(cc), where=clear), (cc + ss) / 2

    def ripple(self, orders: list[int]) -> Array:
        """Return the joint ripple of the orders with given indices, shape (n,)."""
        own = self.columns[:, orders]
        Q, _ = orthonormal(np.hstack([own.real, own.imag]))
        return np.asarray(Q @ (Q.T @ self.residual))


def _piece(robot: Robot, s: Signals, each: Stacked, solution: Array) -> _Piece:
    reach = half_window(s.period)
    own = slice(each.index[0] - reach, each.index[-1] + reach + 1)
    angle = robot.gear_ratio[each.axis] * s.q[own, each.axis]
    columns = smooth_at(each.index - own.start, multiples(angle, ORDERS).T, s.period)
    residual = each.torques[:, 0] - each.X @ solution[place(robot, each.axis)]
    free, _ = orthonormal(each.friction)
    return _Piece(project_out(free, columns), project_out(free, residual))


def _found(pieces: list[_Piece], chance: float) -> tuple[dict[int, float], list[Array]]:
    """Return orders with amplitudes [N m], and the ripple in every piece [N m]."""
    bound = special.chdtri(2 * len(pieces), chance) / special.chdtri(2 * len(pieces), 0.5)
    orders: dict[int, float] = {}
    places: list[int] = []
    ripple = [np.zeros_like(piece.residual) for piece in pieces]
    while len(places) < len(ORDERS) // 2:
        left = zip(pieces, ripple, strict=True)
        each = [piece.explained(piece.residual - known) for piece, known in left]
        explained, size = np.sum(each, axis=0)
        level, best = float(np.median(explained)), int(np.argmax(explained))
        if not explained[best] > bound * level:
            break
        places.append(best)
        orders[ORDERS[best]] = float(np.sqrt((explained[best] - level) / size[best]))
        ripple = [piece.ripple(places) for piece in pieces]
    return orders, ripple
