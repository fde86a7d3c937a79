"""The law of friction of a model: what friction each axis's drive has to overcome, and how surely.

A sum of terms of velocity and load (`hil.friction.terms`) for each axis, whatever was identified.
Three things are uncertain of it. The terms are, from the recordings they were found in. At speeds
that no sample had, laws that fit all samples equally well go apart (`hil.friction.search`). And
friction itself changes with temperature and lubricant, which no term knows: while strokes were
measured it had another level in each of them. How far it wandered there, as a share of the level,
is kept and counts in every interval: an axis that has rested is at one end of what the campaign has
seen, not at its mean. Where the warmth of the gear explains a part of that (`hil.friction.warmth`),
the level can be that of a stated warmth.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from pydantic import model_validator

from checked_files.yaml_file import FileModel
from hil.friction.direction import Direction, are_successive, at_once, bent, friction_direction
from hil.friction.terms import DIRECTED, coupled_friction, friction_columns, motor_angle
from hil.friction.warmth import Exposure, Warmth, states_at
from hil.least_squares.uncertainty import TWICE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from hil.arrays import Array, Mask
    from hil.friction.warmth import History
    from hil.model.robot import Robot


class TermValue(FileModel):
    """Coefficient of one term of friction [N m or N], or a like number, and its standard error."""

    value: float
    standard_error: float

    @classmethod
    def estimated(cls, value: float, variance: float) -> Self:
        """From a variance, which rounding may leave below zero."""
        return cls(value=float(value), standard_error=math.sqrt(max(variance, 0.0)))

    @classmethod
    def named(cls, names: Iterable[str], values: Array, covariance: Array) -> dict[str, Self]:
        """Coefficients by the names of their terms."""
        rows = zip(names, values, np.diag(covariance), strict=True)
        return {name: cls.estimated(value, variance) for name, value, variance in rows}


class OneWay(FileModel):
    """An axis that moves in one direction only, where Coulomb friction and offset are one column.

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
            "moves in one direction only, so Coulomb friction and an offset cannot be separated:"
            f" together they are {value:.3g} ± {half:.2g}"
        )


SLOWEST = 0.02
"""Share of an axis's speed below which free motions show presliding in place of a law: the least
dead zone beside it (docs, free-motions.md). From 0.005 to 0.2 the TX40's model leaves 7.8 % of its
torques below 100 Hz, where the level at rest itself bounds friction it is 8.2 %."""


class AxisLaw(FileModel):
    """Friction of one axis, with its uncertainty.

    Attributes
    ----------
    law : str
        One of `hil.friction.terms.LAWS`.
    speed : float
        That velocities are divided by [rad/s or m/s]; the axis hardly ever exceeds it.
    terms : dict of str to TermValue
        By the names of `hil.friction.terms.TERMS`.
    covariance : tuple of tuple of float
        Of the coefficients of `terms`, in their order [(N m)^2 or N^2]; empty in files of earlier
        versions, whose standard errors then count as independent.
    beside : tuple of tuple of float
        Covariance of each of `terms` with the base parameters; empty in files of earlier versions,
        and where friction was found apart from them.
    plain : dict of str to TermValue
        What offset, Coulomb's and viscous friction alone would be, of samples at all speeds: for
        comparison with other sources. The law that was chosen may share them out otherwise.
    presliding : float
        Distance over which friction turns round after a reversal [rad or m]; 0 for at once.
    bend : TermValue
        Of what the direction changes with the logarithm of this distance [N m or N].
    held_out : dict of str to float
        Root mean square error on held-out groups by law, over that of the law chosen, of all axes
        where they were fitted together; empty where no law was chosen.
    level : tuple of float
        Of friction at instants spread evenly over the time recorded, the first and the last
        included, over its mean, which `terms` state; empty where it keeps its level.
    one_way : OneWay, optional
        None for an axis that moves in both directions.
    wander : float
        Greatest difference of the level in one measurement, or at one instant, from the law, as a
        share of it. It counts as one standard deviation: in a measurement the level is a mean
        already. By default that of `level`.
    speeds : tuple of two floats, optional
        Slowest and fastest samples that the law was found from [rad/s or m/s].
    unseen : tuple of tuple of two floats
        Speeds [rad/s or m/s], ascending, and how uncertain it is there how friction changes from
        the nearest of `speeds`, a standard deviation [N m or N]; between them linear.
    measurements : int, optional
        That the law was found from, each of which counts as one draw; None of free motions, and in
        files of earlier versions.
    warmth : Warmth, optional
        What the level depends on besides, where that is identified; the terms are those at its
        reference. `wander` is of the law alone: the warmth of a motion may be unknown.
    exposure : Exposure, optional
        What the axis had gone through in these measurements; None of free motions, and in files of
        earlier versions.
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
    unseen: tuple[tuple[float, float], ...] = ()
    measurements: int | None = None
    warmth: Warmth | None = None
    exposure: Exposure | None = None

    @model_validator(mode="before")
    @classmethod
    def _wander_of_the_level(cls, stated: Any) -> Any:
        if isinstance(stated, dict) and "wander" not in stated and stated.get("level"):
            return stated | {"wander": max(abs(level - 1.0) for level in stated["level"])}
        return stated

    @property
    def values(self) -> Array:
        """Coefficients, shape (n_terms,)."""
        return np.array([each.value for each in self.terms.values()])

    @property
    def directed(self) -> Mask:
        """Terms of the level, which change their sign with the direction, shape (n_terms,)."""
        return np.array([term in DIRECTED for term in self.terms], dtype=bool)

    @property
    def slope(self) -> float:
        """Of the plainest law, Coulomb and viscous friction [N m s/rad or N s/m]."""
        return self.plain["viscous"].value / self.speed

    def known(self, speed: Array) -> Array:
        """Speeds at which the law is taken: those that it was found from, or the nearest of them.

        A sum of terms may go anywhere else; slower and faster the law goes on with `slope`.
        """
        return speed if self.speeds is None else np.clip(speed, *self.speeds)

    def extrapolation(self, speed: Array) -> Array:
        """Standard deviation of friction by what is not known of unseen speeds, shape of `speed`.

        [N m or N]; 0 at the speeds that the law was found from.
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
        """What a warmth, shape (n,), multiplies the level by, shape (n,); () where it has none."""
        if self.warmth is None or warmth is None:
            return np.ones(())
        return self.warmth.factor(warmth)

    def deviation(self, warmth: Array | None) -> Array:
        """Standard deviation of the level as a share of the law's, shape as of `factor`."""
        if self.warmth is None or warmth is None:
            return np.asarray(self.wander)
        return self.warmth.deviation(warmth)


class CoupledFriction(FileModel):
    """Friction of a motor that turns with two joints, from 1, in their combined velocity."""

    motor: int
    joint: int
    viscous: TermValue
    coulomb: TermValue


class FrictionLaw(FileModel):
    """Friction of all axes.

    Attributes
    ----------
    axes : tuple of AxisLaw or None
        None where nothing recorded showed an axis's friction.
    coupled : tuple of CoupledFriction
    """

    axes: tuple[AxisLaw | None, ...]
    coupled: tuple[CoupledFriction, ...] = ()

    @classmethod
    def absent(cls, n_joints: int) -> FrictionLaw:
        """Return the law of joints of unknown friction."""
        return cls(axes=(None,) * n_joints)

    @property
    def known(self) -> bool:
        """Whether friction of any axis is known."""
        return any(self.axes)

    @property
    def unknown(self) -> tuple[int, ...]:
        """Axes, from 1, whose friction nothing showed."""
        return tuple(axis for axis, law in enumerate(self.axes, start=1) if law is None)

    def restricted(self, axes: Collection[int]) -> FrictionLaw:
        """Return the laws of some axes (from 0) alone; the friction of others counts as unknown."""
        own = (law if axis in axes else None for axis, law in enumerate(self.axes))
        return self.model_copy(update={"axes": tuple(own)})

    @property
    def _of_motors(self) -> list[TermValue]:
        """Coefficients of `hil.friction.terms.coupled_friction`."""
        return [part for each in self.coupled for part in (each.viscous, each.coulomb)]


def friction_torque(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    directions: Sequence[Direction] | None = None,
    warmth: Array | None = None,
) -> Array:
    """Torque of friction and ripple of all axes, shape of `q` [N m or N].

    Zero for an axis whose friction is unknown.

    Parameters
    ----------
    q, qd : ndarray, shape (n, n_joints) or (n_joints,)
        [rad or m, and per s].
    load : ndarray, shape of `q`
        Torque of the rigid bodies [N m or N].
    directions : sequence (n_joints,) of Direction, optional
        Of each axis's friction; by default that along the rows, where these are successive samples
        of a motion, and else the sign of the velocity.
    warmth : ndarray, shape of `q`, optional
        Of the gears; by default that at which each law stands. Without effect on axes whose
        warmth is not identified.
    """
    q_rows, qd_rows, loads, warm = _rows(robot, q, qd, load, warmth)
    if directions is None:
        directions = _directions(law, q_rows, qd_rows)
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            columns = law_columns(robot, each, q_rows, qd_rows, loads, axis, directions[axis])
            speed = np.abs(qd_rows[:, axis])
            beyond = directions[axis].sign * each.slope * (speed - each.known(speed))
            bend = each.bend.value * directions[axis].bend
            level = columns[:, each.directed] @ each.values[each.directed] + bend + beyond
            if each.presliding:
                most = _sliding_level(robot, each, q_rows, qd_rows, loads, axis)
                level = np.clip(level, -most, most)
            other = columns[:, ~each.directed] @ each.values[~each.directed]
            found[:, axis] = other + each.factor(_of(warm, axis)) * level
        if law.coupled:
            shared = np.array([part.value for part in law._of_motors])
            found[:, axis] += coupled_friction(robot, qd_rows, axis) @ shared
    return found.reshape(np.shape(q))


def _sliding_level(
    robot: Robot, law: AxisLaw, q: Array, qd: Array, load: Array, axis: int
) -> Array:
    """Size of one axis's friction that slides at its speeds, shape (n,) [N m or N].

    Friction after a reversal is between this size and its negative (Dahl's direction is within -1
    and 1). The columns of the fit hold that for Coulomb friction alone: terms of speed follow the
    velocity at once, and the bend is a linear correction of the distance. Below the slowest speed
    that the law was found from it is no less than there: an axis about to slide holds as much.
    """
    forward, found = Direction(np.ones(len(q)), np.zeros(len(q))), []
    for least in (0.0, law.speeds[0] if law.speeds else SLOWEST * law.speed):
        sliding = np.abs(qd)
        speed = sliding[:, axis] = np.maximum(sliding[:, axis], least)
        columns = law_columns(robot, law, q, sliding, load, axis, forward)
        known = columns[:, law.directed] @ law.values[law.directed]
        found.append(np.abs(known + law.slope * (speed - law.known(speed))))
    return np.maximum(*found)


def friction_variance(
    robot: Robot,
    law: FrictionLaw,
    q: Array,
    qd: Array,
    load: Array,
    warmth: Array | None = None,
    level: Array | None = None,
) -> Array:
    """Variance of `friction_torque`, shape of `q` [(N m)^2 or N^2]; parameters as there.

    By default that of motions like those that the law was found from. `level` is the standard
    deviation of the level elsewhere, as a share of the law's, that broadcasts to the shape of `q`
    and is NaN for axes without one (`level_along`, `level_anywhere`).
    """
    q_rows, qd_rows, loads, warm = _rows(robot, q, qd, load, warmth)
    found = np.zeros(q_rows.shape)
    for axis, each in enumerate(law.axes):
        if each is not None:
            direction, own = at_once(qd_rows[:, axis], each.speed), _of(warm, axis)
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
            found[:, axis] += each.extrapolation(np.abs(qd_rows[:, axis])) ** 2
        if law.coupled:
            error = np.array([part.standard_error for part in law._of_motors])
            found[:, axis] += np.sum((coupled_friction(robot, qd_rows, axis) * error) ** 2, axis=1)
    return found.clip(0.0).reshape(np.shape(q))


def level_along(law: FrictionLaw, past: History, time: Array) -> Array:
    """Return how uncertain the level of each axis's friction is at instants of a history.

    Parameters
    ----------
    past : History
        Of all axes; they are cold where it begins.
    time : ndarray, shape (n,)
        [s].

    Returns
    -------
    ndarray, shape (n, n_joints)
        Standard deviation as a share of the law's level; NaN for axes without an exposure.
    """
    found = np.full((len(time), len(law.axes)), np.nan)
    for axis, each in enumerate(law.axes):
        if each is not None and each.exposure is not None:
            distance = each.exposure.distance(states_at(past, axis, time))
            found[:, axis] = each.exposure.deviation(distance)
    return found


def level_anywhere(law: FrictionLaw, *, warmth_stated: bool = False) -> Array:
    """Return how uncertain the level of each axis's friction is if nothing is known of its past.

    Shape (n_joints,), as a share of the law's level. NaN for axes without an exposure, and for
    those whose warmth is identified where that is stated.
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
    """All as rows of samples, shape (n, n_joints)."""
    rows, rates, loads = (np.reshape(x, (-1, robot.n_joints)) for x in (q, qd, load))
    warm = None if warmth is None else np.reshape(warmth, (-1, robot.n_joints))
    return rows, rates, loads, warm


def _of(warmth: Array | None, axis: int) -> Array | None:
    return None if warmth is None else warmth[:, axis]


def level_at(law: AxisLaw, speed: float) -> tuple[float, float]:
    """Level of friction at one of the speeds that a law was found from, and its standard error.

    [rad/s or m/s], [N m or N]; at no load and without ripple, half of what forward and backward
    differ by.
    """
    qd = np.array([speed, -speed])
    forward, back = friction_columns(qd / law.speed, at_once(qd, law.speed), terms=tuple(law.terms))
    row = (forward - back) / 2
    return float(row @ law.values), float(np.sqrt(max(row @ law.uncertainty @ row, 0.0)))


def _directions(law: FrictionLaw, q: Array, qd: Array) -> list[Direction]:
    """Directions of friction along rows of samples; at once for axes of unknown friction."""
    presliding = any(each is not None and each.presliding for each in law.axes)
    successive, found = presliding and are_successive(q, qd), []
    for each, positions, velocities in zip(law.axes, q.T, qd.T, strict=True):
        if successive and each is not None and each.presliding:
            found.append(bent(partial(friction_direction, positions), each.presliding))
        else:
            found.append(at_once(velocities, 0.0 if each is None else each.speed))
    return found


def law_columns(
    robot: Robot,
    law: AxisLaw,
    q: Array,
    qd: Array,
    load: Array,
    axis: int,
    direction: Direction,
) -> Array:
    """Columns of the terms of an axis's law, shape (n, n_terms)."""
    v, angle = qd[:, axis], motor_angle(robot, q, axis)
    if law.speeds is not None:
        v = np.sign(direction.sign) * law.known(np.abs(v))
    u = v / law.speed
    return friction_columns(u, direction, load[:, axis], angle, terms=tuple(law.terms))
