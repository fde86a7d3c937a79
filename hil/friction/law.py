"""Friction law of a model: friction torque of each axis, with uncertainty.

The law of an axis is a sum of terms of velocity and load (`hil.friction.terms`). Its uncertainty
has four sources. The coefficients of the terms scatter with the recordings. Few measurements show
no law but the simplest, which leaves a part of friction's shape, `misfit`. At speeds without
samples, laws with equal residuals diverge (`hil.friction.search`). Friction itself changes with
temperature and lubricant, without a term for either: each measurement had another level. The
largest deviation of a level, as a share of the level, is part of every interval, since a rested
axis is at an end of the observed levels, not at their mean. Where the warmth of the gear explains a
part of the deviation (`hil.friction.warmth`), the level can be computed for a stated warmth.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from pydantic import model_validator

from checked_files.yaml_file import FileModel
from hil.friction.direction import (
    Direction,
    are_successive,
    bent,
    friction_direction,
    sign_direction,
)
from hil.friction.terms import DIRECTED, coupled_friction, friction_columns, motor_angle
from hil.friction.warmth import Exposure, Warmth
from hil.least_squares.uncertainty import TWICE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from hil.arrays import Array, Mask
    from hil.friction.warmth import History
    from hil.model.robot import Robot


class TermValue(FileModel):
    """Coefficient of a friction term [N m or N], with its standard error."""

    value: float
    standard_error: float

    @classmethod
    def estimated(cls, value: float, variance: float) -> Self:
        """Make a coefficient from its variance, which rounding may leave below zero."""
        return cls(value=float(value), standard_error=math.sqrt(max(variance, 0.0)))

    @classmethod
    def named(cls, names: Iterable[str], values: Array, covariance: Array) -> dict[str, Self]:
        """Return coefficients by the names of the terms."""
        rows = zip(names, values, np.diag(covariance), strict=True)
        return {name: cls.estimated(value, variance) for name, value, variance in rows}


class OneWay(FileModel):
    """Axis with motion in a single direction, where Coulomb friction and offset are one column.

    Attributes
    ----------
    direction : int
        1 or -1.
    together : TermValue
        Offset plus Coulomb friction in this direction [N m or N].
    """

    direction: int
    together: TermValue

    def __str__(self) -> str:
        value, half = self.together.value, TWICE * self.together.standard_error
        return (
            "moves beyond its dead zone in one direction only, so Coulomb friction and an offset "
            f"cannot be separated: together they are {value:.3g} ± {half:.2g}"
        )


SLOWEST = 0.02
"""Lowest speed of the level that bounds presliding, as a share of an axis's reference speed: the
least dead zone (docs, free-motions.md). The TX40's residual up to 100 Hz is 7.8 % for shares from
0.005 to 0.2, and 8.2 % with the level at rest as the bound.
"""


class AxisLaw(FileModel):
    """Friction law of an axis, with uncertainty.

    Attributes
    ----------
    law : str
        One of `hil.friction.terms.LAWS`.
    speed : float
        Reference speed, by which velocities are divided [rad/s or m/s].
    terms : dict of str to TermValue
        Coefficients by the names of `hil.friction.terms.TERMS`.
    covariance : tuple of tuple of float
        Covariance of the coefficients in the order of `terms` [(N m)^2 or N^2]; empty in files of
        earlier versions, whose standard errors count as independent.
    beside : tuple of tuple of float
        Covariance of each of `terms` with the base parameters; empty in files of earlier versions
        and for friction that was estimated separately.
    plain : dict of str to TermValue
        Offset, Coulomb and viscous friction fitted without further terms to samples at all speeds,
        for comparison with other sources.
    presliding : float
        Distance of presliding after a reversal [rad or m]; 0 without presliding.
    bend : TermValue
        Coefficient of the direction's derivative by the logarithm of `presliding` [N m or N].
    held_out : dict of str to float
        Root mean square error on held-out groups by law, relative to the chosen law; of all axes
        if fitted together; empty without a choice.
    level : tuple of float
        Level of friction relative to its mean, at instants spread evenly over the recorded time,
        both ends included; empty for a constant level.
    one_way : OneWay, optional
        Sum of offset and Coulomb friction; None for an axis that moves in both directions.
    wander : float
        Largest relative deviation of the level of a measurement, or at an instant, from the law.
        Counts as one standard deviation, since the level of a measurement is already a mean. By
        default the largest deviation in `level`.
    speeds : tuple of two floats, optional
        Slowest and fastest samples of the fit [rad/s or m/s].
    misfit : float
        Standard deviation of friction within a measurement about the law at the measurement's level
        [N m or N]; 0 for free motions, whose residual contains it.
    unseen : tuple of tuple of two floats
        Speeds without samples [rad/s or m/s], ascending, each with the standard deviation of the
        change of friction from the nearest of `speeds` [N m or N]; linear in between.
    measurements : int, optional
        Number of measurements of the fit, each of which counts as one draw; None for free motions
        and in files of earlier versions.
    warmth : Warmth, optional
        Dependence of the level on warmth, if identified; the terms apply at its reference. `wander`
        ignores warmth, since the warmth of a motion may be unknown.
    exposure : Exposure, optional
        Motion and rest of the axis before and during the measurements; None for free motions and in
        files of earlier versions.
    """

    law: str
    speed: float
    presliding: float = 0.0
    bend: TermValue = TermValue(value=0.0, standard_error=0.0)
    terms: dict[str, TermValue]
    plain: dict[str, TermValue]
    held_out: dict[str, float]
    covariance: tuple[tuple[float, ...], ...] = ()
    beside: tuple[tuple[float, ...], ...] = ()
    level: tuple[float, ...] = ()
    one_way: OneWay | None = None
    wander: float = 0.0
    speeds: tuple[float, float] | None = None
    misfit: float = 0.0
    unseen: tuple[tuple[float, float], ...] = ()
    measurements: int | None = None
    warmth: Warmth | None = None
    exposure: Exposure | None = None

    @model_validator(mode="before")
    @classmethod
    def _default_wander(cls, stated: Any) -> Any:
        if isinstance(stated, dict) and "wander" not in stated and stated.get("level"):
            return stated | {"wander": max(abs(level - 1.0) for level in stated["level"])}
        return stated

    @property
    def values(self) -> Array:
        """Coefficients, shape (n_terms,)."""
        return np.array([each.value for each in self.terms.values()])

    @property
    def directed(self) -> Mask:
        """Mask of the terms that change sign with the direction, shape (n_terms,)."""
        return np.array([term in DIRECTED for term in self.terms], dtype=bool)

    @property
    def slope(self) -> float:
        """Coefficient of viscous friction in the plain law [N m s/rad or N s/m]."""
        return self.plain["viscous"].value / self.speed

    def known(self, speed: Array) -> Array:
        """Clip speeds to the range of the samples of the fit.

        Sums of terms may diverge outside this range, where the law continues with `slope`.
        """
        return speed if self.speeds is None else np.clip(speed, *self.speeds)

    def extrapolation(self, speed: Array) -> Array:
        """Return the standard deviation of extrapolated friction [N m or N], shape of `speed`.

        0 within the range of the samples of the fit.
        """
        if not self.unseen:
            return np.zeros_like(speed)
        return np.asarray(np.interp(speed, *np.transpose(self.unseen)))

    @property
    def uncertainty(self) -> Array:
        """Covariance of the coefficients, shape (n_terms, n_terms)."""
        if self.covariance:
            return np.array(self.covariance)
        return np.diag([each.standard_error**2 for each in self.terms.values()])

    def factor(self, warmth: Array | None) -> Array:
        """Return the factor of the level at a warmth, shape (n,); () without a warmth."""
        if self.warmth is None or warmth is None:
            return np.ones(())
        return self.warmth.factor(warmth)

    def deviation(self, warmth: Array | None) -> Array:
        """Return the relative standard deviation of the level, shape of `factor`."""
        if self.warmth is None or warmth is None:
            return np.asarray(self.wander)
        return self.warmth.deviation(warmth)


class CoupledFriction(FileModel):
    """Friction of a motor that turns with two joints (from 1), in the motor's own velocity."""

    motor: int
    joint: int
    viscous: TermValue
    coulomb: TermValue


class FrictionLaw(FileModel):
    """Friction of all axes.

    Attributes
    ----------
    axes : tuple of AxisLaw or None
        None for an axis of unknown friction.
    """

    axes: tuple[AxisLaw | None, ...]
    coupled: tuple[CoupledFriction, ...] = ()

    @classmethod
    def absent(cls, n_joints: int) -> FrictionLaw:
        """Return the law of joints of unknown friction."""
        return cls(axes=(None,) * n_joints)

    @property
    def known(self) -> bool:
        """True if the friction of any axis is known."""
        return any(self.axes)

    @property
    def unknown(self) -> tuple[int, ...]:
        """Axes of unknown friction, from 1."""
        return tuple(axis for axis, law in enumerate(self.axes, start=1) if law is None)

    def restricted(self, axes: Collection[int]) -> FrictionLaw:
        """Return the law of `axes` (from 0) alone, with unknown friction elsewhere."""
        own = (law if axis in axes else None for axis, law in enumerate(self.axes))
        return self.model_copy(update={"axes": tuple(own)})

    @property
    def motor_terms(self) -> list[TermValue]:
        """Coefficients of the columns of `hil.friction.terms.coupled_friction`."""
        return [part for each in self.coupled for part in (each.viscous, each.coulomb)]


def friction_torque(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    directions: Sequence[Direction] | None = None,
    warmth: Array | None = None,
    change: Array | None = None,
) -> Array:
    """Return the torque of friction and ripple, shape of `q` [N m or N].

    Zero for an axis of unknown friction.

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints) or (n_joints,)
        Positions and velocities [rad or m, and per s].
    load : ndarray, shape of `q`
        Torque of the rigid bodies [N m or N].
    directions : sequence (n_joints,) of Direction, optional
        Direction of each axis's friction. By default computed along the rows if these are
        successive samples of a motion, otherwise the sign of the velocity.
    warmth : ndarray, shape of `q`, optional
        Warmth of the gears; by default the reference of each law. Warmth has no effect on axes
        without an identified warmth.
    change : ndarray, shape (n, n_joints), optional
        Relative changes of the friction level (`level_along`).
    """
    q_rows, qd_rows, loads, warm = _rows(robot, q, qd, load, warmth)
    if directions is None:
        presliding = any(each is not None and each.presliding for each in law.axes)
        successive, directions = presliding and are_successive(q_rows, qd_rows), list[Direction]()
        for each, positions, velocities in zip(law.axes, q_rows.T, qd_rows.T, strict=True):
            if successive and each is not None and each.presliding:
                directions.append(bent(partial(friction_direction, positions), each.presliding))
            else:
                directions.append(sign_direction(velocities, 0.0 if each is None else each.speed))
    forward = Direction(np.ones(len(q_rows)), np.zeros(len(q_rows)))
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            columns = law_columns(robot, each, q_rows, qd_rows, loads, axis, directions[axis])
            speed = np.abs(qd_rows[:, axis])
            beyond = directions[axis].sign * each.slope * (speed - each.known(speed))
            bend = each.bend.value * directions[axis].bend
            level = columns[:, each.directed] @ each.values[each.directed] + bend + beyond
            if each.presliding:
                # Dahl's direction is within -1 and 1, so presliding never exceeds sliding friction.
                # The columns of the fit obey this bound for Coulomb friction alone: terms of speed
                # follow the velocity at once, and `bend` is a linear correction of the distance.
                # Below the slowest sample of the fit the bound stays at least as large as at this
                # sample: an axis about to slide holds as much.
                bounds = []
                for least in (0.0, each.speeds[0] if each.speeds else SLOWEST * each.speed):
                    sliding = np.abs(qd_rows)
                    speed = sliding[:, axis] = np.maximum(sliding[:, axis], least)
                    rows = law_columns(robot, each, q_rows, sliding, loads, axis, forward)
                    known = rows[:, each.directed] @ each.values[each.directed]
                    bounds.append(np.abs(known + each.slope * (speed - each.known(speed))))
                most = np.maximum(*bounds)
                level = np.clip(level, -most, most)
            other = columns[:, ~each.directed] @ each.values[~each.directed]
            more = 0.0 if change is None else change[:, axis]
            found[:, axis] = other + (each.factor(_axis_warmth(warm, axis)) + more) * level
        if law.coupled:
            shared = np.array([part.value for part in law.motor_terms])
            found[:, axis] += coupled_friction(robot, qd_rows, axis) @ shared
    return found.reshape(np.shape(q))


def friction_variance(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    warmth: Array | None = None,
    level: Array | None = None,
) -> Array:
    """Return the variance of `friction_torque`, shape of `q` [(N m)^2 or N^2].

    Without `level` the variance is that for motions like those of the fit. `level` is the relative
    standard deviation of the level in other motions; it broadcasts to the shape of `q` and is NaN
    for axes without an exposure (`level_along`, `level_anywhere`). Other parameters are those of
    `friction_torque`.
    """
    q_rows, qd_rows, loads, warm = _rows(robot, q, qd, load, warmth)
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            direction, own = sign_direction(qd_rows[:, axis], each.speed), _axis_warmth(warm, axis)
            columns = law_columns(robot, each, q_rows, qd_rows, loads, axis, direction)
            friction = columns[:, each.directed] @ each.values[each.directed]
            scale = np.reshape(each.factor(own), (-1, 1))
            columns = np.where(each.directed, scale * columns, columns)
            found[:, axis] = np.einsum("nk,kl,nl->n", columns, each.uncertainty, columns)
            away = each.deviation(own)
            if level is not None:
                known = np.broadcast_to(level, found.shape)[:, axis]
                away = np.where(np.isnan(known), away, known)
            found[:, axis] += (away * friction) ** 2
            found[:, axis] += each.extrapolation(np.abs(qd_rows[:, axis])) ** 2 + each.misfit**2
        if law.coupled:
            error = np.array([part.standard_error for part in law.motor_terms])
            found[:, axis] += np.sum((coupled_friction(robot, qd_rows, axis) * error) ** 2, axis=1)
    return found.clip(0.0).reshape(np.shape(q))


def level_along(law: FrictionLaw, past: History, time: Array) -> tuple[Array, Array]:
    """Compute the change of each axis's friction level at instants of a history.

    Parameters
    ----------
    past : History
        History of all axes, which are cold at its beginning.
    time : ndarray, shape (n,)
        Instants [s].

    Returns
    -------
    change : ndarray, shape (n, n_joints)
        Relative change of the level, known in motions that the law's measurements cover; else 0.
    deviation : ndarray, shape (n, n_joints)
        Relative standard deviation about this level; NaN for axes without an exposure.
    """
    change, deviation = np.zeros((2, len(time), len(law.axes)))
    deviation[:] = np.nan
    for axis, each in enumerate(law.axes):
        if each is not None and each.exposure is not None:
            change[:, axis], deviation[:, axis] = each.exposure.level_along(past, axis, time)
    return change, deviation


def level_anywhere(law: FrictionLaw, *, warmth_stated: bool = False) -> Array:
    """Compute the uncertainty of each axis's friction level for an unknown past.

    Relative standard deviations have shape (n_joints,). They are NaN for axes without an exposure
    and, for a stated warmth, for axes with an identified warmth.
    """
    return np.array(
        [
            np.nan
            if each is None or each.exposure is None or (warmth_stated and each.warmth is not None)
            else each.exposure.deviation(each.exposure.anywhere)
            for each in law.axes
        ]
    )


def _rows(
    robot: Robot, q: Array, qd: Array, load: Array, warmth: Array | None
) -> tuple[Array, Array, Array, Array | None]:
    """Reshape all arrays to rows of samples, shape (n, n_joints)."""
    rows, rates, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    warm = None if warmth is None else np.reshape(warmth, (-1, robot.n_joints))
    return rows, rates, loads, warm


def _axis_warmth(warmth: Array | None, axis: int) -> Array | None:
    return None if warmth is None else warmth[:, axis]


def level_at(law: AxisLaw, speed: float) -> tuple[float, float]:
    """Return the friction level at a speed [rad/s or m/s], with its standard error [N m or N].

    The level is half of the difference between forward and backward friction, without load and
    ripple. The speed must be within the range of the samples of the fit.
    """
    qd = np.array([speed, -speed])
    forward, back = friction_columns(
        qd / law.speed, sign_direction(qd, law.speed), terms=tuple(law.terms)
    )
    row = (forward - back) / 2
    return float(row @ law.values), float(np.sqrt(max(row @ law.uncertainty @ row, 0.0)))


def law_columns(
    robot: Robot, law: AxisLaw, q: Array, qd: Array, load: Array, axis: int, direction: Direction
) -> Array:
    """Return the columns of the terms of an axis's law, shape (n, n_terms)."""
    v, angle = qd[:, axis], motor_angle(robot, q, axis)
    if law.speeds is not None:
        v = np.sign(direction.sign) * law.known(np.abs(v))
    u = v / law.speed
    return friction_columns(u, direction, load[:, axis], angle, terms=tuple(law.terms))
