"""Bodies with given base parameters nearest to likely bodies.

The distance is the entropic divergence of normal distributions with pseudo-inertias J and J_0,

    tr J_0^-1 J - log det J + log det J_0 - 4,

which depends on neither frames nor units and keeps each J well inside the cone of positive definite
matrices (Lee, Wensing and Park, IEEE Transactions on Robotics 36 (2020) 168-182). It is convex in J
and self-concordant; Newton's method with damped steps finds its minimum from any start (Boyd and
Vandenberghe, Convex Optimization, section 9.6). Other conditions, on masses and rotors, enter with
their log det.

Likely bodies from shapes are known up to scale: `rescaled` finds the common factors of mass, a, and
of length, b, that minimise the divergence. Let s, t and m be the sums of tr J_0^-1 J over the
spatial, the mixed and the mass block. In u = 1/b the total s u^2 + t u + m gives the minimum where
s u^2 - t u - 3 m = 0, and a is a quarter of the total's mean over the links.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.frames import pseudo_inertia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.consistent.semidefinite import Inequality

    _Blocks = Sequence[tuple[Inequality, float]]

_DECREMENT = 1e-9
_RIDGE = 1e-13
_ROUNDING = 1e-9
_SHORTEST_STEP = 1e-9


def likeliest(
    bodies: Sequence[Inequality], others: Sequence[Inequality], pull: Array, z: Array
) -> Array:
    """Minimise the divergence from likely bodies over the free coordinates z.

    Parameters
    ----------
    bodies : sequence of Inequality
        Matrix of each link as a function of z, in units that make the likely body the unit matrix;
        positive definite at the start.
    others : sequence of Inequality
        Further conditions that hold at the start.
    pull : ndarray, shape (n_free,)
        Small weight of each z's square, which decides directions that change no body.
    z : ndarray, shape (n_free,)
        Start.
    """
    # weight of a scalar condition's logarithm, against 1 of a body's log det
    weights = [1.0] * len(bodies) + [1e-3] * len(others)
    slope = np.sum([np.einsum("kkn->n", each.weights) for each in bodies], axis=0)
    inside = [_entered(each, z) for each in (*bodies, *others)]
    return _newton(list(zip(inside, weights, strict=True)), slope, pull, z)


def rescaled(likely: Array, bodies: Array) -> Array:
    """Return likely bodies with the scale nearest to `bodies`, both of shape (n_joints, 10)."""
    spatial = mixed = mass = 0.0
    for expected, body in zip(likely, bodies, strict=True):
        parts = np.linalg.inv(pseudo_inertia(expected)) * pseudo_inertia(body)
        spatial += float(parts[:3, :3].sum())
        mixed += 2.0 * float(parts[:3, 3].sum())
        mass += float(parts[3, 3])
    u = (mixed + np.sqrt(mixed**2 + 12.0 * spatial * mass)) / (2.0 * spatial)
    heavier = (spatial * u**2 + mixed * u + mass) / (4.0 * len(likely))
    powers = np.array([2.0] * 6 + [1.0] * 3 + [0.0])
    return np.asarray(heavier * likely * u**-powers)


def _entered(block: Inequality, z: Array) -> Inequality:
    """Widen an inequality by the violation at the start, due to rounding in a solver."""
    lack = _ROUNDING - float(np.linalg.eigvalsh(block.constant + block.weights @ z)[0])
    return block._replace(constant=block.constant + max(lack, 0.0) * np.eye(len(block.constant)))


def _newton(blocks: _Blocks, slope: Array, pull: Array, z: Array) -> Array:
    """Minimise ``slope z + pull z^2 / 2 - sum weight log det`` by Newton's method."""
    # maximum number of Newton steps
    for _ in range(200):
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
        # a whole step, or nine tenths of the distance to a condition's boundary
        worst = 0.0
        for block, _ in blocks:
            root = np.linalg.inv(np.linalg.cholesky(block.constant + block.weights @ z))
            moved = root @ (block.weights @ step) @ root.T
            worst = max(worst, -float(np.linalg.eigvalsh((moved + moved.T) / 2)[0]))
        length = min(1.0, 0.9 / worst) if worst > 0 else 1.0
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
