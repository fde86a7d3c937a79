"""Friction of one axis: terms, and laws made up of them, from simple to rich.

Terms are functions of the axis's velocity, as a share u of the speed that it hardly ever exceeds;
of the torque that it transmits; and, for ripple of motors and gears, which is no friction but as
periodic, of the motor's angle. Coulomb's friction and the offset together are one that differs by
direction. Cube root and arc tangent are degressive, as Stribeck's effect makes friction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from hil.least_squares.ripple import RIPPLE_ORDERS
from hil.least_squares.terms import curved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.bristles import Direction

    Array = NDArray[np.float64]

SpeedTerm = Literal[
    "offset", "Coulomb", "viscous", "asymmetric", "cube root", "arc tangent", "quadratic", "load"
]
TERMS: tuple[str, ...] = (
    *get_args(SpeedTerm),
    *(f"{wave} {order}" for order in RIPPLE_ORDERS for wave in ("cosine", "sine")),
)
"""Terms of friction, in the order of their columns."""
BENT = "bend"
"""What Coulomb's friction changes by with the logarithm of the presliding distance."""
COLUMNS = (*TERMS, BENT)
"""Unknowns of an axis's friction, in their order."""
_RIPPLE = TERMS[len(get_args(SpeedTerm)) :]
CLASSICAL = ("offset", "Coulomb", "viscous")
"""What most of the literature fits."""
_RICH = get_args(SpeedTerm)
LAWS: dict[str, tuple[str, ...]] = {
    "offset": ("offset",),
    "Coulomb": ("offset", "Coulomb"),
    "Coulomb and viscous": CLASSICAL,
    "asymmetric": (*CLASSICAL, "asymmetric"),
    "cube root": (*CLASSICAL, "cube root"),
    "arc tangent": (*CLASSICAL, "arc tangent"),
    "load": (*CLASSICAL, "load"),
    "asymmetric cube root": (*CLASSICAL, "asymmetric", "cube root"),
    "asymmetric arc tangent": (*CLASSICAL, "asymmetric", "arc tangent"),
    "cube root and load": (*CLASSICAL, "cube root", "load"),
    "all speeds and load": _RICH,
    "Coulomb, viscous and ripple": (*CLASSICAL, *_RIPPLE),
    "all": (*_RICH, *_RIPPLE),
}
"""Laws by name, from the simplest; later ones have more terms."""


def friction_columns(
    u: Array, direction: Direction, load: Array, angle: Array, rate: Array
) -> Array:
    """Columns of one axis's friction, shape (n, n_columns), in the order of `COLUMNS`.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Velocity as a share of the axis's speed.
    direction : Direction
        The sign of the velocity, or what follows it over the presliding distance.
    load : ndarray, shape (n,)
        Torque that is transmitted [N m or N].
    angle : ndarray, shape (n,)
        Of the motor [rad]; without effect where it is 0 throughout.
    rate : ndarray, shape (n,)
        Share of the rate at which samples can follow the motor's turning, 1 being the greatest:
        what ripples faster, the low-pass takes away in any case.
    """
    loaded = np.abs(load) * direction.sign
    speeds = np.ones(len(u)), direction.sign, u, np.abs(u), *curved(u), loaded
    return np.column_stack([*speeds, *_ripple(angle, np.abs(rate)), direction.bend])


def _ripple(angle: Array, rate: Array) -> list[Array]:
    if not angle.any():
        return [np.zeros(len(angle))] * len(_RIPPLE)
    waves, once = [], np.exp(1j * angle)
    power = np.ones_like(once)
    for order in RIPPLE_ORDERS:
        power = power * once
        seen = np.where(order * rate < 1.0, power, 0.0)
        waves += [seen.real, seen.imag]
    return waves
