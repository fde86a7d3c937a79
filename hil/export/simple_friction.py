"""Friction models of simulators: Coulomb and viscous friction, or the Stribeck curve.

    Coulomb and viscous    F = c sgn v + b v
    Stribeck               F = (c + (s - c) exp(-(v / v_s)^2)) sgn v + b v

with c, s, b >= 0, as simulators require. Both are fitted to the identified law of friction, at no
load and at 50 speeds, evenly over the range of identification (non-negative least squares; v_s is
the best of 40 within that range, spaced by ratio). Both models are odd functions: offset, asymmetry
and ripple of the law are left out. Therefore every approximation comes with its misfit, which
includes the omitted parts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from hil.errors import NotEnoughData
from hil.results.identified_robot import friction_alone, known_friction, lacking
from hil.show.rounding import percent, significant

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.friction.law import AxisLaw
    from hil.results.model import Model


NOTABLE = 1e-6
"""Smallest offset, as a share of friction, that is not rounding."""


class Stribeck(NamedTuple):
    """Stribeck curve: c, s and b of the module, v_s, and the misfit as in `SimpleFriction`."""

    coulomb: float
    static: float
    viscous: float
    velocity: float
    misfit: float


@dataclass(frozen=True, slots=True, eq=False)
class SimpleFriction:
    """Friction of an axis in the models of simulators, on the joint side.

    Attributes
    ----------
    axis : int
        Index from 0.
    speeds : ndarray, shape (n,)
        Speeds at which the law is evaluated [rad/s or m/s].
    forward, backward : ndarray, shape (n,)
        Friction by the law at these speeds and at their negatives, at no load [N m or N].
    coulomb, viscous : float
        Coefficients, not negative [N m or N; N m s/rad or N s/m].
    misfit : float
        Root mean square, over both directions, of the law less this approximation [N m or N].
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
    def offset(self) -> float:
        """Mean of the law over both directions, not due to friction [N m or N]."""
        return float(np.mean([self.forward, self.backward]))

    @property
    def constant(self) -> float:
        """Offset that is not only rounding [N m or N]."""
        return self.offset if abs(self.offset) > NOTABLE * self.size else 0.0

    @property
    def size(self) -> float:
        """Root mean square of the law [N m or N]."""
        return float(np.sqrt(np.mean(np.square([self.forward, self.backward]))))


def simple_friction(model: Model, warmth: float | None = None) -> tuple[SimpleFriction, ...]:
    """Return the friction of all axes with a known law in the models of simulators.

    Parameters
    ----------
    model : Model
    warmth : float, optional
        Warmth of the gears, from 0 cold to 1 warm; by default the reference of the laws.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    laws = enumerate(known_friction(model).axes)
    return tuple(_fit_axis(model, axis, law, warmth) for axis, law in laws if law is not None)


def _fit_axis(model: Model, axis: int, law: AxisLaw, warmth: float | None) -> SimpleFriction:
    # from 5 % of the axis's speed on, if the range of the law's data is unknown
    v = np.linspace(*(law.speeds or (0.05 * law.speed, law.speed)), 50)
    forward, backward = (friction_alone(model, axis, side * v, warmth)[0] for side in (1.0, -1.0))
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
    for velocity in np.geomspace(v[0], v[-1], 40):
        bell = np.exp(-((v / velocity) ** 2))
        found, left = optimize.nnls(np.column_stack([1.0 - bell, bell, v]), odd)
        coulomb, static, viscous = found.tolist()
        fits.append(Stribeck(coulomb, static, viscous, float(velocity), _misfit(left, even)))
    return min(fits, key=lambda each: each.misfit)


def _misfit(left: float, even: Array) -> float:
    """Return the root mean square over both directions; `left`: norm of the odd part's residual."""
    return float(np.sqrt((left**2 + even @ even) / len(even)))


def friction_of_joints(model: Model) -> tuple[SimpleFriction | None, ...]:
    """Return the friction of each joint; None if the model has no law of friction."""
    try:
        found = {each.axis: each for each in simple_friction(model)}
    except NotEnoughData:
        found = {}
    return tuple(found.get(axis) for axis in range(model.robot.n_joints))


def friction_remarks(model: Model, offsets: str = "") -> tuple[str, ...]:
    """Return the misfits of Coulomb and viscous friction, or the reason for missing friction.

    `offsets` names the part that holds the offset of a law; by default the offset is left out.
    """
    try:
        simple = simple_friction(model)
        found = [*misfits(model, simple), *_offsets(model, simple, offsets)]
    except NotEnoughData:
        return (
            "no friction is stated, because the model has no friction law: identify a run that "
            "moves all axes (hil identify)",
        )
    return (*found, *presliding_left_out(model))


def misfits(model: Model, simple: tuple[SimpleFriction, ...], state: str = "") -> list[str]:
    """Return the misfits of Coulomb and viscous friction; `state`: of the gears, for the text.

    The misfit is at no load and away from reversals; load-dependent friction is named separately.
    """
    lack = lacking(model)
    return [
        *((f"FRICTION UNKNOWN: {lack}",) if lack and not state else ()),
        *(
            f"axis {each.axis + 1}{state}: Coulomb {significant(each.coulomb, 3)} and viscous "
            f"{significant(each.viscous, 3)} {model.robot.torque_unit(each.axis)} "
            f"s/{model.robot.position_unit(each.axis)} differ from the law by "
            f"{significant(each.misfit, 2)} {model.robot.torque_unit(each.axis)} rms "
            f"({percent(each.misfit, each.size)} % of friction){_load_remark(model, each.axis)}"
            for each in simple
        ),
    ]


def _offsets(model: Model, simple: tuple[SimpleFriction, ...], place: str) -> Iterator[str]:
    """Yield the constant torque of each axis, with the place in the exported files."""
    what = f"is {place}" if place else "is left out: add it to the commanded torque"
    for each in simple:
        if each.constant:
            unit = model.robot.torque_unit(each.axis)
            yield (
                f"axis {each.axis + 1}: the constant torque of {significant(each.offset, 3)} {unit}"
                f" of the friction law (offset) {what}"
            )


def presliding_left_out(model: Model, where: str = "") -> tuple[str, ...]:
    """Describe presliding omitted by a format; `where` continues the sentence with an exception."""
    axes = [
        f"axis {axis} over {significant(own.presliding, 2)} {model.robot.position_unit(axis - 1)}"
        for axis, own in enumerate(model.friction_law.axes, start=1)
        if own is not None and own.presliding
    ]
    return (f"presliding is left out{where}: {', '.join(axes)}",) if axes else ()


def _load_remark(model: Model, axis: int) -> str:
    """Return a remark on the omitted friction due to load; empty without such friction."""
    law = known_friction(model).axes[axis]
    if law is None or "load" not in law.terms:
        return ""
    share = significant(law.terms["load"].value, 2)
    return f"; load-dependent friction, {share} of the load, is left out"
