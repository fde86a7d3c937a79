"""Friction in the terms of simulators: Coulomb's and viscous friction, or Stribeck's curve.

    Coulomb and viscous    F = c sgn v + b v
    Stribeck               F = (c + (s - c) exp(-(v / v_s)^2)) sgn v + b v

with c, s, b >= 0, or no simulator takes them. Both are fitted to the law of friction that was
identified, at no load and evenly over the range of speeds that it was found from (non-negative
least squares; v_s from a grid within that range). They are odd functions: offset, asymmetry and
ripple of the law are left out. So every simplification comes with its misfit, which counts those
too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from hil.friction.law import friction_torque
from hil.results.torque_parts import known_friction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.results.model import Model

    Array = NDArray[np.float64]

SPEEDS = 50
"""At which the law is read."""
GRID = 40
"""Values of v_s that are tried."""
SLOWEST = 0.05
"""Share of an axis's speed from which on its law counts where the range found is not stated."""


class Stribeck(NamedTuple):
    """Stribeck's curve: c, s and b of the module, v_s, and the misfit as of `SimpleFriction`."""

    coulomb: float
    static: float
    viscous: float
    velocity: float
    misfit: float


@dataclass(frozen=True, slots=True, eq=False)
class SimpleFriction:
    """Friction of one axis as simulators have it; joint side.

    Attributes
    ----------
    axis : int
        From 0.
    speeds : ndarray, shape (n,)
        At which the law was read [rad/s or m/s].
    forward, backward : ndarray, shape (n,)
        The law at these speeds and at their negatives, at no load [N m or N].
    coulomb, viscous : float
        Not negative [N m or N; N m s/rad or N s/m].
    misfit : float
        Root mean square, over both directions, of the law less this [N m or N].
    stribeck : Stribeck
    """

    axis: int
    speeds: Array
    forward: Array
    backward: Array
    coulomb: float
    viscous: float
    misfit: float
    stribeck: Stribeck

    @property
    def size(self) -> float:
        """Root mean square of the law itself [N m or N]."""
        return float(np.sqrt(np.mean(np.square([self.forward, self.backward]))))


def simple_friction(model: Model, warmth: float | None = None) -> tuple[SimpleFriction, ...]:
    """Return the friction of all axes whose law is known in the terms of simulators.

    Parameters
    ----------
    model : Model
    warmth : float, optional
        Of the gears, from 0 cold to 1 warm; by default that at which the laws stand.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    laws = enumerate(known_friction(model).axes)
    return tuple(_of_axis(model, axis, warmth) for axis, law in laws if law is not None)


def speeds_of(model: Model, axis: int) -> tuple[float, float]:
    """Slowest and fastest speed at which an axis's law holds [rad/s or m/s]."""
    law = known_friction(model).axes[axis]
    assert law is not None  # noqa: S101 - asked of axes that have one
    return law.speeds or (SLOWEST * law.speed, law.speed)


def _of_axis(model: Model, axis: int, warmth: float | None) -> SimpleFriction:
    v = np.linspace(*speeds_of(model, axis), SPEEDS)
    forward, backward = (_law(model, axis, side * v, warmth) for side in (1.0, -1.0))
    odd, even = (forward - backward) / 2, (forward + backward) / 2
    (coulomb, viscous), left = optimize.nnls(np.column_stack([np.ones_like(v), v]), odd)
    return SimpleFriction(
        axis=axis,
        speeds=v,
        forward=forward,
        backward=backward,
        coulomb=float(coulomb),
        viscous=float(viscous),
        misfit=_misfit(left, even),
        stribeck=_stribeck(v, odd, even),
    )


def _stribeck(v: Array, odd: Array, even: Array) -> Stribeck:
    fits = []
    for velocity in np.geomspace(v[0], v[-1], GRID):
        bell = np.exp(-((v / velocity) ** 2))
        found, left = optimize.nnls(np.column_stack([1.0 - bell, bell, v]), odd)
        coulomb, static, viscous = found.tolist()
        fits.append(Stribeck(coulomb, static, viscous, float(velocity), _misfit(left, even)))
    return min(fits, key=lambda each: each.misfit)


def _misfit(left: float, even: Array) -> float:
    """Root mean square over both directions; `left`: norm of what is left of the odd part."""
    return float(np.sqrt((left**2 + even @ even) / len(even)))


def _law(model: Model, axis: int, v: Array, warmth: float | None) -> Array:
    """Friction of an axis that moves alone, at no load [N m or N]."""
    qd = np.zeros((len(v), model.robot.n_joints))
    qd[:, axis] = v
    still = np.zeros_like(qd)
    state = None if warmth is None else np.full_like(qd, warmth)
    found = friction_torque(model.robot, known_friction(model), still, qd, still, warmth=state)
    return np.asarray(found[:, axis])
