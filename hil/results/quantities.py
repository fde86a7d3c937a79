"""Quantities of a model for comparison over months: base parameters, friction levels, offsets.

A quantity is compared between models of a robot. Common errors of all models, those of torque
constants and rotor inertias, are not included: they are equal in every run and cancel in the
difference. Friction is read from the model's law, at no load and at stated speeds. Its level is the
part that changes its sign with the direction,

F(v) = (f(v) - f(-v)) / 2,

so that models may have different laws. The allowance is the change of the level by temperature
within a campaign, the wander of the law.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from scipy import special

from hil.friction.law import level_at
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from hil.model.robot import Robot
    from hil.results.identified_robot import IdentifiedRobot

Kind = Literal["gravity parameter", "inertia parameter", "friction level", "offset"]
SHARES = (0.1, 0.7)
"""Positions of the reference speeds in the range of speeds known to all models, as shares."""
OF_LIMIT = (0.1, 0.3, 0.7)
"""Speeds of levels for comparisons of many machines, as shares of the joint's velocity limit.
Three speeds, since the law of a campaign may not cover the slowest or the fastest one."""
ASSUMED = (0.1, 0.8)
"""Assumed range of speeds for a law without a stated range, as shares of its speed."""


class Quantity(NamedTuple):
    """Quantity in the models of a robot.

    Attributes
    ----------
    name : str
        ``p5``, ``friction of axis 3 at 0.5 rad/s`` or ``offset of axis 3``.
    kind : {"gravity parameter", "inertia parameter", "friction level", "offset"}
    about : str
        Expression of a parameter; empty for friction and offsets.
    axis : int or None
        Axis of friction or offset, from 1.
    speed : float or None
        Speed of a friction level [rad/s or m/s].
    meaning : str
        Meaning of a parameter; empty for friction and offsets, which have descriptive names.
    """

    name: str
    kind: Kind
    unit: str
    about: str = ""
    axis: int | None = None
    speed: float | None = None
    meaning: str = ""

    @property
    def title(self) -> str:
        """Meaning, with the name of a parameter: ``gravity of axis 2 (p5)``."""
        return f"{self.meaning} ({self.name})" if self.meaning else self.name


class Reading(NamedTuple):
    """Value of a quantity in a model.

    Attributes
    ----------
    value, standard_error : float
        Value, and standard error of the run's own errors [unit of the quantity].
    degrees : float
        Effective degrees of freedom of the standard error.
    allowance : float
        Permitted difference between runs without any change of the machine.
    stands_for : str
        Sum identified in place of the parameter; empty for the parameter itself.
    """

    value: float
    standard_error: float
    degrees: float
    allowance: float = 0.0
    stands_for: str = ""

    @property
    def half_width(self) -> float:
        """Half-width of the 95 % interval, without the allowance."""
        return float(special.stdtrit(self.degrees, 0.975)) * self.standard_error


def quantities(models: Sequence[IdentifiedRobot]) -> tuple[Quantity, ...]:
    """Return the quantities common to models of a robot, parameters first."""
    robot = models[0].robot
    base = base_parameters(robot)
    found = []
    for k, name in enumerate(base.names):
        kind: Kind = "gravity parameter" if k in base.groups["gravity"] else "inertia parameter"
        about, meaning = base.expressions[k], base.meanings[k]
        found.append(Quantity(name, kind, base.units[k], about, meaning=meaning))
    for axis in range(robot.n_joints):
        laws = [law for model in models if (law := model.friction_law.axes[axis]) is not None]
        ranges = [law.speeds or tuple(share * law.speed for share in ASSUMED) for law in laws]
        # speeds inside the common range of the laws; none without this range
        slowest = max((low for low, _ in ranges), default=0.0)
        fastest = min((high for _, high in ranges), default=0.0)
        shares = SHARES if slowest < fastest else ()
        speeds = [slowest + share * (fastest - slowest) for share in shares]
        found += _friction(robot, axis, speeds) if laws else ()
    return tuple(found)


def reading(
    model: IdentifiedRobot,
    quantity: Quantity,
    least_wander: float = 0.0,
    unknown_wander: float = 0.05,
) -> Reading | None:
    """Return the value of a quantity in a model; None if unknown.

    Parameters
    ----------
    least_wander : float
        Minimum change of the friction level by temperature, as a share, for any campaign.
    unknown_wander : float
        Assumed change for laws without known wander, such as those from free motions.
    """
    if quantity.axis is None:
        k = model.names.index(quantity.name)
        if not model.identified[k]:
            return None
        error = float(np.sqrt(max(model.scatter_covariance[k, k], 0.0)))
        value, degrees = float(model.values[k]), float(model.degrees_of_freedom[k])
        return Reading(value, error, degrees, stands_for=model.details.sum_of(model.names[k]))
    law = model.friction_law.axes[quantity.axis - 1]
    if law is None:
        return None
    degrees = 2.0  # the fewest, without measurements of the axis
    if law.measurements is not None:
        degrees = max(float(law.measurements - len(law.terms)), degrees)
    elif model.details.with_law:
        degrees = float(np.median(model.degrees_of_freedom))
    if quantity.speed is None:
        # the offset of a law with |u| is its value at rest, otherwise the mean over all speeds
        offset = law.plain.get("offset")
        return None if offset is None else Reading(offset.value, offset.standard_error, degrees)
    level, error = level_at(law, quantity.speed)
    wander = max(law.wander or unknown_wander, least_wander)
    return Reading(level, error, degrees, wander * abs(level))


def friction_quantities(robot: Robot) -> Iterator[Quantity]:
    """Yield friction levels at shares of each joint's velocity limit, and offsets.

    These quantities are common to all runs of a robot and independent of the laws. Without a
    velocity limit there are only offsets.
    """
    for axis, limit in enumerate(robot.velocity_limit.tolist()):
        shares = OF_LIMIT if np.isfinite(limit) else ()
        yield from _friction(robot, axis, [share * limit for share in shares])


def _friction(robot: Robot, axis: int, speeds: Iterable[float]) -> Iterator[Quantity]:
    """Yield friction levels of an axis at speeds with two digits, and its offset."""
    unit = robot.torque_unit(axis)
    for speed in (float(f"{each:.2g}") for each in speeds):
        name = f"friction of axis {axis + 1} at {speed:g} {robot.position_unit(axis)}/s"
        yield Quantity(name, "friction level", unit, axis=axis + 1, speed=speed)
    yield Quantity(f"offset of axis {axis + 1}", "offset", unit, axis=axis + 1)
