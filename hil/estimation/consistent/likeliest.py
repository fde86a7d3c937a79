"""Of all bodies that have given base parameters, those nearest to likely ones.

Near is meant by the entropic divergence of normal distributions with pseudo-inertias J and a J_0,

    tr (a J_0)^-1 J - log det J + 4 log a - const,

which depends on neither frames nor units and keeps each J well inside the cone of positive
definite matrices (Lee, Wensing and Park, IEEE Transactions on Robotics 36 (2020) 168-182). The
scale a of all likely bodies together is chosen too, a = mean tr J_0^-1 J / 4, since torques know
better what a robot weighs than its shape does. For a given a this is convex and self-concordant;
Newton's method with damped steps finds its minimum from any start (Boyd and Vandenberghe, Convex
Optimization, section 9.6). Other conditions, on masses and rotors, enter with their log det.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.consistent.semidefinite import Inequality

    Array = NDArray[np.float64]
    _Blocks = Sequence[tuple[Inequality, float]]

BARRIER = 1e-3
"""Weight of a scalar condition's logarithm, against 1 of a body's log det."""
SCALINGS = 30
"""Times that scale and bodies are found from each other, at most."""
STEPS = 200
"""Of Newton's method, at most."""
_DECREMENT = 1e-9
_SAME_SCALE = 1e-6
_RIDGE = 1e-13
_SHORTEST_STEP = 1e-9


def likeliest(
    bodies: Sequence[Inequality], others: Sequence[Inequality], pull: Array, z: Array
) -> Array:
    """Minimise the divergence of the module over z.

    Parameters
    ----------
    bodies : sequence of Inequality
        Matrix of each link as a function of z, in units in which the likely body is the unit
        matrix; positive definite at the start.
    others : sequence of Inequality
        Further conditions, which hold at the start.
    pull : ndarray, shape (n_free,)
        Small weight of each z's square, which decides what no body does.
    z : ndarray, shape (n_free,)
        Start.
    """
    weights = [1.0] * len(bodies) + [BARRIER] * len(others)
    blocks = list(zip([*bodies, *others], weights, strict=True))
    traces = np.sum([np.einsum("kkn->n", each.weights) for each in bodies], axis=0)
    constant = sum(float(np.trace(each.constant)) for each in bodies)
    size = sum(len(each.constant) for each in bodies)
    scale = 0.0
    for _ in range(SCALINGS):
        before, scale = scale, (constant + float(traces @ z)) / size
        if abs(scale - before) < _SAME_SCALE * scale:
            break
        z = _newton(blocks, traces / scale, pull, z)
    return z


def _newton(blocks: _Blocks, slope: Array, pull: Array, z: Array) -> Array:
    """Minimum of ``slope z + pull z^2 / 2 - sum weight log det``."""
    for _ in range(STEPS):
        gradient, hessian = slope + pull * z, np.diag(pull)
        for block, weight in blocks:
            inverse = np.linalg.inv(block.constant + block.weights @ z)
            turned = np.einsum("ij,jkn->nik", inverse, block.weights)
            gradient = gradient - weight * np.einsum("nii->n", turned)
            hessian = hessian + weight * np.einsum("nij,mji->nm", turned, turned, optimize=True)
        unit = 1.0 / np.sqrt(np.diag(hessian))
        scaled = hessian * np.outer(unit, unit) + _RIDGE * np.eye(len(z))
        step = -unit * np.linalg.solve(scaled, unit * gradient)
        descent = -float(gradient @ step)
        if descent < _DECREMENT:
            break
        length = _longest([block for block, _ in blocks], z, step)
        here = _value(blocks, slope, pull, z)
        while _value(blocks, slope, pull, z + length * step) > here - 0.1 * length * descent:
            length /= 2
            if length < _SHORTEST_STEP:
                return z
        z = z + length * step
    return z


def _value(blocks: _Blocks, slope: Array, pull: Array, z: Array) -> float:
    dets = [w * np.linalg.slogdet(block.constant + block.weights @ z)[1] for block, w in blocks]
    return float(slope @ z + pull @ z**2 / 2 - sum(dets))


def _longest(blocks: Sequence[Inequality], z: Array, step: Array) -> float:
    """The whole step, or nine tenths of the way to where a condition ceases to hold."""
    worst = 0.0
    for block in blocks:
        root = np.linalg.inv(np.linalg.cholesky(block.constant + block.weights @ z))
        moved = root @ (block.weights @ step) @ root.T
        worst = max(worst, -float(np.linalg.eigvalsh((moved + moved.T) / 2)[0]))
    return min(1.0, 0.9 / worst) if worst > 0 else 1.0
