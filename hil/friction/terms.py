"""Terms of friction and laws made of terms, from simple to rich.

Terms are functions of an axis's velocity, as a share u of the reference speed, of its direction, of
the transmitted torque, of the distance, and of the motor angle for the torque ripple of motors and
gears. Coulomb friction and offset together describe Coulomb friction that differs by direction.
Cube root and arc tangent are degressive, like friction with Stribeck effect. Every coefficient is a
torque or a force, except for those of the load, which are shares of the load.

A motor that turns with two joints has viscous and Coulomb friction in its own velocity, which acts
on both joints.
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
"""Share of the reference speed at the knee of the arc tangent, between the bends of the cube root
(at rest) and of the quadratic term (at full speed).
"""


class _Samples(NamedTuple):
    """Arguments of friction terms, each of shape (n,)."""

    u: Array
    direction: Direction
    load: Array
    gone: Array


class Term(NamedTuple):
    """Term of a friction law.

    Attributes
    ----------
    formula : str
        Factor of the coefficient, as a function of velocity v and share u.
    column : callable
        Column of the regression for samples.
    directed : bool
        True for a term that changes sign with the direction and is part of the friction level.
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
"""Terms of speed and load, in column order."""
DIRECTED = tuple(name for name, term in OF_SPEED.items() if term.directed)
"""Terms that change sign with the direction: the level of friction."""
BENT, LOAD_BY_DIRECTION, DRIFT = "bend", "load by direction", "drift"
_OTHERS = {
    BENT: Term("", lambda s: s.direction.bend, directed=True),
    LOAD_BY_DIRECTION: Term("|load|", lambda s: np.abs(s.load), directed=False),
    DRIFT: Term("", lambda s: s.direction.sign * s.gone, directed=True),
}
"""Terms for changes of Coulomb friction: with the logarithm of the presliding distance, with the
load by direction, and with the travelled distance of the axis."""
WAVES = ("cosine", "sine")
RIPPLE = tuple(f"{wave} {order}" for order in RIPPLE_ORDERS for wave in WAVES)
"""Torque ripple over the motor angle, order by order."""
TERMS = (*OF_SPEED, *RIPPLE)
"""Terms of laws, in column order."""
COLUMNS = (*TERMS, BENT)
"""Unknowns of an axis's friction in free motions, in column order."""
CLASSICAL = ("offset", "Coulomb", "viscous")
"""Terms fitted in most of the literature."""
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
"""Default law."""


def friction_columns(
    u: Array,
    direction: Direction,
    load: Array | None = None,
    angle: Array | None = None,
    rate: Array | None = None,
    gone: Array | None = None,
    terms: Sequence[str] = COLUMNS,
) -> Array:
    """Return the columns of an axis's friction, shape (n, n_terms).

    Parameters
    ----------
    u : ndarray, shape (n,)
        Velocity as a share of the axis's speed.
    direction : Direction
        Sign of the velocity, or direction with presliding.
    load : ndarray, shape (n,), optional
        Transmitted torque [N m or N]; none by default.
    angle : ndarray, shape (n,), optional
        Motor angle [rad]; no ripple if 0 throughout, the default.
    rate : ndarray, shape (n,), optional
        Speed of the motor as a share of the largest speed that the sample rate resolves. Ripple of
        order n is 0 if n times this share is 1 or more, since the low-pass removes the ripple.
    gone : ndarray, shape (n,), optional
        Distance of the axis, in any unit.
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
    """Return the motor angle of an axis [rad], or the motor speed from joint velocities."""
    return np.asarray(np.nan_to_num(robot.gear_ratio[axis]) * q[:, axis])


def coupled_friction(robot: Robot, qd: Array, axis: int) -> Array:
    """Return the columns of coupled motors' friction on an axis, shape (n, 2 n_couplings)."""
    columns = np.zeros((len(qd), 2 * len(robot.couplings)))
    for k, (motor, joint, ratio) in enumerate(robot.couplings):
        if axis not in (motor, joint):
            continue
        other = motor if axis == joint else joint
        turning = ratio * qd[:, joint] + qd[:, motor]
        columns[:, 2 * k] = ratio * qd[:, other]
        columns[:, 2 * k + 1] = np.sign(turning) * (ratio if axis == joint else 1.0)
    return columns
