"""Friction models of simulators: Coulomb and viscous, Stribeck curve, or quadratic damping.

    Coulomb and viscous    F = c sgn v + b v
    Stribeck               F = (c + (s - c) exp(-(v / v_s)^2)) sgn v + b v
    quadratic damping      F = c sgn v + b v + d v |v|

with c, s >= 0, as simulators require, and b >= 0 for the first two. These are fitted to the
identified law of friction, at no load and at 50 speeds, evenly over the range of identification
(non-negative least squares; v_s is the best of 40 within that range, spaced by ratio). All models
are odd functions: offset, asymmetry and ripple of the law are left out. Therefore every
approximation comes with its misfit, which includes the omitted parts.

Quadratic damping is that of MuJoCo. It is fitted to simulated motion instead of torque: a mass m
that coasts from a speed u has, at a speed v, moved by m times the integral of w / F(w) from v to u
since the start, within m times the integral of 1 / F(w). The largest difference of positions at the
law's instants, relative to the law's distance to rest, is least over both directions and `STARTS`
speeds, with a constant torque beside the friction. Quadratic damping takes the place of Coulomb and
viscous friction where their positions are wrong by `COASTS`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import integrate, optimize

from hil.errors import NotEnoughData
from hil.results.identified_robot import friction_alone, known_friction, lacking
from hil.show.rounding import percent, significant

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hil.arrays import Array
    from hil.results.model import Model


NOTABLE = 1e-6
"""Smallest part, as a share of friction, that is not rounding."""
COASTS = 0.01
"""Allowed error of positions relative to the distance to rest: half of 2 %, the rest is for the
time step."""
SLOW, STARTS = 0.25, 5
"""Slowest start of coasting, as a share of the fastest speed, and number of starts, spaced by
ratio. Quadratic damping misses laws of Stribeck friction by 2 % from slower starts."""
POWERS = (1, 4, 16)
"""Powers of the errors whose sums of squares are least in turn; the last sum is of large errors."""
TO_REST = np.array([1e-3, 0.1, 0.2, 0.4, 0.6, 0.8])
"""Speeds of a law below 5 % of the axis's speed, as shares of that, as fine as `GRID`. The first is
that of rest, where friction has no direction."""
GRID = 100
"""Number of intervals of speed for integrals over it."""


class Stribeck(NamedTuple):
    """Stribeck curve: c, s and b of the module, v_s, and the misfit as in `SimpleFriction`."""

    coulomb: float
    static: float
    viscous: float
    velocity: float
    misfit: float


class Quadratic(NamedTuple):
    """Quadratic damping: c, b and d of the module, constant torque, misfit of `SimpleFriction`."""

    coulomb: float
    viscous: float
    quadratic: float
    offset: float
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
    coasting : Quadratic
        Friction that simulates coasting; Coulomb and viscous friction where that is right.
    """

    axis: int
    speeds: Array
    forward: Array
    backward: Array
    coulomb: float
    viscous: float
    misfit: float
    stribeck: Stribeck
    coasting: Quadratic

    @property
    def damping(self) -> tuple[float, ...]:
        """Coefficients of speed in `coasting`: one, or three of MuJoCo's polynomial."""
        _, viscous, quadratic, _, _ = self.coasting
        return (viscous, quadratic, 0.0) if quadratic else (viscous,)

    @property
    def offset(self) -> float:
        """Constant torque, not due to friction: mean of both directions [N m or N]."""
        return self.coasting.offset

    @property
    def constant(self) -> float:
        """Offset that is not only rounding [N m or N]."""
        return self.offset if abs(self.offset) > NOTABLE * self.size else 0.0

    @property
    def size(self) -> float:
        """Root mean square of the law [N m or N]."""
        return float(np.sqrt(np.mean(np.square([self.forward, self.backward]))))


def simple_friction(model: Model, warmth: float | None = None) -> tuple[SimpleFriction, ...]:
    """Return the friction of axes with a known law in the models of simulators.

    The law of an axis at rest in all recordings is unknown, but for the torque at rest.

    Parameters
    ----------
    warmth : float, optional
        Warmth of the gears, from 0 cold to 1 warm; by default the reference of the laws.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    simple = []
    for axis, law in enumerate(known_friction(model).axes):
        if law is None or axis + 1 in model.details.rest:
            continue
        # from 5 % of the axis's speed on, if the range of the law's data is unknown
        v = np.linspace(*(law.speeds or (0.05 * law.speed, law.speed)), 50)
        # below its slowest data a law is that of this speed; a law of unknown range holds to rest
        slow = np.empty(0) if law.speeds else v[0] * TO_REST
        u = np.concatenate([slow, v])
        sides = [friction_alone(model, axis, s * u, warmth)[0] for s in (1.0, -1.0)]
        errors = _position_errors(u, (sides[0] - sides[1]) / 2, (sides[0] + sides[1]) / 2)
        forward, backward = (side[len(slow) :] for side in sides)
        odd, even = (forward - backward) / 2, (forward + backward) / 2
        (coulomb, viscous), left = optimize.nnls(np.column_stack([np.ones_like(v), v]), odd)
        constant = float(np.mean(even))
        plain = Quadratic(float(coulomb), float(viscous), 0.0, constant, _misfit(left, even))
        fits = []
        for velocity in np.geomspace(v[0], v[-1], 40):
            bell = np.exp(-((v / velocity) ** 2))
            found, left = optimize.nnls(np.column_stack([1.0 - bell, bell, v]), odd)
            coulomb, static, viscous = found.tolist()
            fits.append(Stribeck(coulomb, static, viscous, float(velocity), _misfit(left, even)))
        simple.append(
            SimpleFriction(
                axis=axis,
                speeds=v,
                forward=forward,
                backward=backward,
                coulomb=plain.coulomb,
                viscous=plain.viscous,
                misfit=plain.misfit,
                stribeck=min(fits, key=lambda each: each.misfit),
                coasting=_coasting(v, odd, even, plain, errors),
            )
        )
    return tuple(simple)


def _coasting(
    v: Array, odd: Array, even: Array, plain: Quadratic, errors: Callable[[Array], Array]
) -> Quadratic:
    """Return `plain`, or quadratic damping that never drives and coasts nearer to the law."""
    if (np.abs(even) >= odd).any():  # one direction drives
        return plain
    start = np.array(plain[:4])
    if np.abs(errors(start)).max() <= COASTS:
        return plain
    scale = odd.max() / v[-1] ** np.array([0, 1, 2, 0])
    low, x = [0.0, -np.inf, 0.0, -np.inf], start / scale
    for power in POWERS:
        unit = float(np.abs(errors(scale * x)).max())

        def powers(x: Array, power: int = power, unit: float = unit) -> Array:
            return np.asarray((errors(scale * x) / unit) ** power)

        x = optimize.least_squares(powers, x, bounds=(low, np.inf)).x
    found = scale * x
    if found[2] * v[-1] ** 2 <= NOTABLE * odd.max():  # not beyond the rounding of the bound
        found[2] = 0.0
    c, b, d, constant = found.tolist()
    nearer = np.abs(errors(found)).max() < np.abs(errors(start)).max()
    if not nearer or (b < 0 and b**2 >= 4 * c * d):
        return plain
    left = float(np.linalg.norm(odd - np.vander(v, 3, increasing=True) @ found[:3]))
    return Quadratic(c, b, d, constant, _misfit(left, even))


def _position_errors(v: Array, odd: Array, even: Array) -> Callable[[Array], Array]:
    """Return a function from c, b, d and constant torque to relative errors of coasting."""
    starts = np.geomspace(SLOW, 1.0, STARTS) * v[-1]
    u = np.union1d(np.linspace(0.0, v[-1], GRID + 1), starts)
    at, powers = np.searchsorted(u, starts), np.vander(u, 3, increasing=True)

    def coasted(friction: Array) -> tuple[Array, Array]:
        """Return time and distance that are left at each speed."""
        slowness = 1.0 / np.maximum(friction, NOTABLE * odd.max())
        time, way = (
            np.asarray(integrate.cumulative_trapezoid(each, u, initial=0), dtype=np.float64)
            for each in (slowness, u * slowness)
        )
        return time, way

    # below the slowest speed friction is that of this speed
    laws = [(side, *coasted(np.interp(u, v, odd + side * even))) for side in (1.0, -1.0)]

    def errors(found: Array) -> Array:
        moved = []
        for side, time, way in laws:
            times, ways = coasted(powers @ found[:3] + side * found[3])
            for k in at.tolist():
                left = np.interp(times[k] - time[k] + time[: k + 1], times, ways)
                ahead = ways[k] - left - (way[k] - way[: k + 1])
                moved += [ahead / way[k], ways[k : k + 1] / way[k] - 1.0]
        return np.concatenate(moved)

    return errors


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
        found = misfits(model, simple)
    except NotEnoughData:
        return (
            "no friction is stated, because the model has no friction law: identify a run that "
            "moves all axes (hil identify)",
        )
    what = f"is {offsets}" if offsets else "is left out: add it to the commanded torque"
    for each in simple:
        if each.constant:
            found.append(
                f"axis {each.axis + 1}: the constant torque of {significant(each.offset, 3)} "
                f"{model.robot.torque_unit(each.axis)} of the friction law (offset) {what}"
            )
    return (*found, *presliding_left_out(model))


def misfits(model: Model, simple: tuple[SimpleFriction, ...], state: str = "") -> list[str]:
    """Return the misfits of Coulomb and viscous friction; `state`: of the gears, for the text.

    The misfit is at no load and away from reversals; load-dependent friction is named separately.
    """
    lack = lacking(model)
    found = [f"FRICTION UNKNOWN: {lack}"] if lack and not state else []
    if model.details.rest and not state:
        axes = ", ".join(map(str, model.details.rest))
        found.append(f"friction of axis {axes} is unknown: at rest in all recordings")
    for each in simple:
        unit = model.robot.torque_unit(each.axis)
        law = known_friction(model).axes[each.axis]
        by_load = ""
        if law is not None and "load" in law.terms:
            share = significant(law.terms["load"].value, 2)
            by_load = f"; load-dependent friction, {share} of the load, is left out"
        found.append(
            f"axis {each.axis + 1}{state}: Coulomb {significant(each.coulomb, 3)} and viscous "
            f"{significant(each.viscous, 3)} {unit} s/{model.robot.position_unit(each.axis)} "
            f"differ from the law by {significant(each.misfit, 2)} {unit} rms "
            f"({percent(each.misfit, each.size)} % of friction){by_load}"
        )
    return found


def damping_remarks(model: Model) -> Iterator[str]:
    """Yield the axes whose friction is chosen for coasting, with the misfit."""
    for each in friction_of_joints(model):
        if each is None or each.coasting[:2] == (each.coulomb, each.viscous):
            continue
        c, b, d, _, misfit = each.coasting
        unit = model.robot.torque_unit(each.axis)
        damping = f"damping {significant(b, 3)} {unit} s/{model.robot.position_unit(each.axis)}"
        if d:
            damping = "a polynomial of damping (MuJoCo 3.7 or later)"
        yield (
            f"axis {each.axis + 1}: frictionloss {significant(c, 3)} {unit} and {damping}, with "
            f"which simulated coasting is right, miss the law by {significant(misfit, 2)} {unit} "
            "rms; for other simulators write the Coulomb and viscous friction stated for this axis"
        )


def presliding_left_out(model: Model, where: str = "") -> tuple[str, ...]:
    """Describe presliding omitted by a format; `where` continues the sentence with an exception."""
    axes = [
        f"axis {axis} over {significant(own.presliding, 2)} {model.robot.position_unit(axis - 1)}"
        for axis, own in enumerate(model.friction_law.axes, start=1)
        if own is not None and own.presliding
    ]
    return (f"presliding is left out{where}: {', '.join(axes)}",) if axes else ()
