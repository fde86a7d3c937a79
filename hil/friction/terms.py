"""Terms of friction, and laws made up of them, from simple to rich.

Terms are functions of an axis's velocity, as a share u of the speed that it hardly ever exceeds; of
its direction; of the torque that it transmits; of the distance that it has gone; and, for ripple of
motors and gears, which is no friction but as periodic, of the motor's angle. Coulomb's friction and
the offset together are one that differs by direction. Cube root and arc tangent are degressive, as
Stribeck's effect makes friction. Every coefficient is a torque or a force, except for those of the
load, which are shares of it.

A motor that turns with two joints has friction in its own velocity besides, viscous and Coulomb's,
which both joints feel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.arrays import side_by_side
from hil.friction.ripple import RIPPLE_ORDERS, multiples

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array
    from hil.friction.direction import Direction
    from hil.model.robot import Robot


BEND = 0.08
"""Share of the speed at which the arc tangent bends: between rest, where the cube root does, and
full speed, where the quadratic does."""


class _Samples(NamedTuple):
    """What friction is a function of, each of shape (n,)."""

    u: Array
    direction: Direction
    load: Array
    gone: Array


class Term(NamedTuple):
    """A term of friction.

    Attributes
    ----------
    formula : str
        What its coefficient is multiplied by, of velocity v and share u.
    column : callable
        The same of samples.
    directed : bool
        Whether it changes its sign with the direction: those terms are the level of friction.
    """

    formula: str
    column: Callable[[_Samples], Array]
    directed: bool


OF_SPEED = {
    "offset": Term("1", lambda s: np.ones(len(s.u)), directed=False),
    "Coulomb": Term("sgn(v)", lambda s: s.direction.sign, directed=True),
    "viscous": Term("u", lambda s: s.u, directed=True),
    "asymmetric": Term("|u|", lambda s: np.abs(s.u), directed=False),
    "cube root": Term("cbrt(u)", lambda s: np.cbrt(s.u), directed=True),
    "arc tangent": Term(f"atan(u / {BEND})", lambda s: np.arctan(s.u / BEND), directed=True),
    "quadratic": Term("u |u|", lambda s: s.u * np.abs(s.u), directed=True),
    "load": Term("|load| sgn(v)", lambda s: np.abs(s.load) * s.direction.sign, directed=True),
}
"""Terms of speed and load, in the order of their columns."""
DIRECTED = tuple(name for name, term in OF_SPEED.items() if term.directed)
"""Terms that change their sign with the direction: the level of friction."""
BENT, LOAD_BY_DIRECTION, DRIFT = "bend", "load by direction", "drift"
_OTHERS = {
    BENT: Term("", lambda s: s.direction.bend, directed=True),
    LOAD_BY_DIRECTION: Term("|load|", lambda s: np.abs(s.load), directed=False),
    DRIFT: Term("", lambda s: s.direction.sign * s.gone, directed=True),
}
"""What Coulomb's friction changes by with the logarithm of the presliding distance; with the load,
by direction; and over the distance that the axis goes."""
WAVES = ("cosine", "sine")
RIPPLE = tuple(f"{wave} {order}" for order in RIPPLE_ORDERS for wave in WAVES)
"""Ripple over the motor's angle, wave by wave."""
TERMS = (*OF_SPEED, *RIPPLE)
"""Terms of laws, in the order of their columns."""
COLUMNS = (*TERMS, BENT)
"""Unknowns of an axis's friction in free motions, in their order."""
CLASSICAL = ("offset", "Coulomb", "viscous")
"""What most of the literature fits."""
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
    "all speeds and load": tuple(OF_SPEED),
    "Coulomb, viscous and ripple": (*CLASSICAL, *RIPPLE),
    "all": TERMS,
}
"""Laws by name, from the simplest; later ones have more terms."""
USUAL = "Coulomb and viscous"
"""Law that stands unless the data call for another."""


def friction_columns(
    u: Array,
    direction: Direction,
    load: Array | None = None,
    angle: Array | None = None,
    rate: Array | None = None,
    gone: Array | None = None,
    terms: Sequence[str] = COLUMNS,
) -> Array:
    """Columns of one axis's friction, shape (n, n_terms).

    Parameters
    ----------
    u : ndarray, shape (n,)
        Velocity as a share of the axis's speed.
    direction : Direction
        The sign of the velocity, or what follows it over the presliding distance.
    load : ndarray, shape (n,), optional
        Torque that is transmitted [N m or N]; none by default.
    angle : ndarray, shape (n,), optional
        Of the motor [rad]; without ripple where it is 0 throughout, as by default.
    rate : ndarray, shape (n,), optional
        Share of the rate at which samples can follow the motor's turning, 1 being the greatest:
        what ripples faster, the low-pass takes away in any case.
    gone : ndarray, shape (n,), optional
        Distance that the axis has gone, in any unit.
    terms : sequence of str
        Names of the columns.
    """
    none = np.zeros(len(u))
    samples = _Samples(u, direction, none if load is None else load, none if gone is None else gone)
    waves: dict[str, Array] = {}
    if angle is not None and angle.any() and any(term in RIPPLE for term in terms):
        for order, wave in zip(RIPPLE_ORDERS, multiples(angle, RIPPLE_ORDERS), strict=True):
            seen = wave if rate is None else np.where(order * np.abs(rate) < 1.0, wave, 0.0)
            waves |= {f"cosine {order}": seen.real, f"sine {order}": seen.imag}
    shapes = OF_SPEED | _OTHERS
    return side_by_side(*(
        shapes[term].column(samples) if term in shapes else waves.get(term, none) for term in terms
    ))  # fmt: skip


def motor_angle(robot: Robot, q: Array, axis: int) -> Array:
    """Angle of one axis's motor [rad], or its rate from joint velocities; 0 where unknown."""
    return np.asarray(np.nan_to_num(robot.gear_ratio[axis]) * q[:, axis])


def coupled_friction(robot: Robot, qd: Array, axis: int) -> Array:
    """Columns of the coupled motors' friction as one axis feels it, shape (n, 2 n_couplings)."""
    columns = np.zeros((len(qd), 2 * len(robot.couplings)))
    for k, (motor, joint, ratio) in enumerate(robot.couplings):
        if axis not in (motor, joint):
            continue
        other = motor if axis == joint else joint
        turning = ratio * qd[:, joint] + qd[:, motor]
        columns[:, 2 * k] = ratio * qd[:, other]
        columns[:, 2 * k + 1] = np.sign(turning) * (ratio if axis == joint else 1.0)
    return columns
