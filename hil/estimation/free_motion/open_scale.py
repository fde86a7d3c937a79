"""Scales that unknown gains leave open, whatever the signals are: a matter of structure.

Parameters, friction and gain of some axes may be multiplied alike without a change of any torque
unless one of these axes shares parameters with an axis of known gain, or turns a rotor of known
inertia. Then the column of such a gain (`scaling`) is a combination of the others. Whether it is
does not depend on the values of the parameters, almost all being alike in this; so they are drawn
at random, and no signal enters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.free_motion.friction_terms import CLASSICAL
from hil.estimation.free_motion.scaling import Scaling
from hil.estimation.free_motion.system import kept_unknowns, summed
from hil.model.base_parameters import base_parameters
from hil.regression.layout import embedded
from hil.regression.least_squares import IDENTIFIABLE, undetermined
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

REMEDY = (
    "state one gain in the map or a rotor_inertia in the robot file, or record the same motion with"
    " a load of known mass (hil payload --mass --gains)"
)
_TINY = np.finfo(float).tiny


def require_scale(robot: Robot, recorded: Products, unknown: tuple[int, ...]) -> None:
    """Refuse motions whose torques leave a scale open.

    Raises
    ------
    NotIdentifiable
        It names the gains and the base parameters that are determined only up to scale.
    """
    names = base_parameters(robot).names
    # at one draw by chance a parameter may have no part in what is open, hardly at two
    draws = [_open(recorded, unknown, len(names), seed) for seed in range(2)]
    gains, parameters = (np.logical_or(*each) for each in zip(*draws, strict=True))
    if not gains.any():
        return
    axes = [axis for axis, each in zip(unknown, gains, strict=True) if each]
    listed = ", ".join(name for name, each in zip(names, parameters, strict=True) if each)
    both = f"{'it' if len(axes) == 1 else 'them'} {listed or 'all its friction'}"
    raise NotIdentifiable(
        f"{gains_of(axes)} and with {both} are determined only up to scale: multiplied alike they"
        f" leave all torques as they are; {REMEDY}"
    )


def _open(
    recorded: Products, unknown: tuple[int, ...], n_base: int, seed: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Unknown gains and base parameters that are in a scale left open, at drawn parameters."""
    n = recorded.n_joints
    x, total = _any_solution(recorded, unknown, seed), summed(recorded.pieces).sum(axis=0)
    modelled = Scaling(np.ones(n), tuple(range(n)), x).columns(recorded)
    size = np.einsum("jak,jab,jbk->j", modelled, total, modelled)
    products = Scaling(np.ones(n), unknown, x).applied(recorded)
    kept = kept_unknowns(products.n_shared, [CLASSICAL] * n)
    weights = 1.0 / np.maximum(size, _TINY)
    N = normal(summed(products.pieces), products.n_shared, weights).only(kept).information
    gains = np.arange(products.n_shared - len(unknown), products.n_shared)
    linear = np.delete(np.arange(len(N)), gains)
    lost = undetermined(N, IDENTIFIABLE)
    before = undetermined(N[np.ix_(linear, linear)], IDENTIFIABLE)
    return lost[gains], lost[:n_base] & ~before[:n_base]


def open_gains(recorded: Products, unknown: tuple[int, ...]) -> list[int]:
    """Axes, from 0, of unknown gains that are in a scale left open."""
    if not unknown:
        return []
    lost = np.logical_or(*(_open(recorded, unknown, 0, seed)[0] for seed in range(2)))
    return [axis for axis, each in zip(unknown, lost, strict=True) if each]


def gains_of(axes: Sequence[int]) -> str:
    """Unknown gains of axes, from 0, in words."""
    listed = ", ".join(str(axis + 1) for axis in axes)
    many = len(axes) > 1
    return f"the unknown gain{'s' * many} of ax{'es' if many else 'is'} {listed}"


def mean_signal(recorded: Products) -> Array:
    """Mean squares of the signals as they were recorded, shape (n_joints,)."""
    counts = recorded.counts.sum(axis=(0, 2))
    found: Array = np.maximum(recorded.squares / np.maximum(counts, 1.0), _TINY)
    return found


def usual_torque(recorded: Products, unknown: tuple[int, ...]) -> float:
    """Mean square of the torques of known gain, or else of the known rotors [N^2 m^2 or N^2]."""
    known = np.delete(mean_signal(recorded), unknown)
    if known.size:
        return float(known.mean())
    rotor, counts = recorded.n_shared, recorded.counts.sum(axis=(0, 2))
    squares = summed(recorded.pieces)[:, :, rotor, rotor].sum(axis=0)
    return float(np.mean(squares / np.maximum(counts, 1.0))) or 1.0


def _any_solution(recorded: Products, unknown: tuple[int, ...], seed: int) -> Array:
    """Parameters and classical friction drawn at random, their torques of usual size."""
    n, linear = recorded.n_joints, recorded.n_shared - 1
    counts = np.maximum(recorded.counts.sum(axis=(0, 2)), 1.0)[:, np.newaxis]
    squares = np.einsum("jkk->jk", summed(recorded.pieces).sum(axis=0))[:, 1:] / counts
    shared, own = squares[:, :linear].mean(axis=0), squares[:, linear + 1 :]
    size = np.concatenate([shared, own.ravel()])
    kept = kept_unknowns(linear, [CLASSICAL] * n)
    drawn = embedded(np.random.default_rng(seed).standard_normal(len(kept)), kept, len(size))
    usual = np.sqrt(usual_torque(recorded, unknown) / len(kept))
    found: Array = np.where(size > 0, drawn, 0.0) * usual / np.sqrt(np.maximum(size, _TINY))
    return found
