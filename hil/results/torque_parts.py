"""The torque of a drive by its parts, and how certain their sum is.

    Q = A(q, qd, qdd) p + H qdd + F(q, qd, A p)

Rigid bodies, motors, eq. (6) and (7), and friction. Each part is computed here and nowhere else.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import FrictionUnknown, NotEnoughData, UnknownName
from hil.estimation.intervals import combined_degrees, half_width
from hil.friction.law import friction_torque, friction_variance
from hil.model import dynamics
from hil.model.motors import motor_torque
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from collections.abc import Collection

    from hil.arrays import Array
    from hil.friction.law import FrictionLaw
    from hil.results.identified_robot import IdentifiedRobot

PARTS = ("rigid bodies", "motors", "friction")
"""Of the torque that a drive gives; gravity alone is `hil.results.model.Model.gravity`."""


def torque_of(
    model: IdentifiedRobot,
    parts: Collection[str],
    q: Array,
    qd: Array,
    qdd: Array,
    warmth: Array | None = None,
) -> Array:
    """Sum of the `parts` of the torque, shape of `q` [N m or N]; `warmth` has that shape too.

    Errors and warnings as of `hil.results.model.Model.torque`.
    """
    if unknown := [part for part in parts if part not in PARTS]:
        raise UnknownName(f"{unknown[0]!r}: parts of the torque are {', '.join(PARTS)}")
    law = known_friction(model) if "friction" in parts else None
    if law is not None and (lack := lacking(model)):
        # once a line of the caller's, as Python does by default
        text = f"torques of {model.robot.name} lack friction: {lack}"
        warnings.warn(text, FrictionUnknown, stacklevel=3)
    rigid = dynamics.inverse_dynamics(model.robot, model.values, q, qd, qdd)
    total = rigid if "rigid bodies" in parts else np.zeros_like(rigid)
    if "motors" in parts:
        total = total + motor_torque(model.robot, q, qd, qdd)
    if law is None:
        return total
    return total + friction_torque(model.robot, law, q, qd, rigid, warmth=warmth)


def interval_of(
    model: IdentifiedRobot,
    parts: Collection[str],
    q: Array,
    qd: Array,
    qdd: Array,
    level: float,
    *,
    of_samples: bool,
    warmth: Array | None = None,
) -> Array:
    """Half-widths of intervals of `torque_of`, shape of `q` [N m or N].

    NaN for axes whose friction is among the parts and unknown.

    Motors add nothing: what is wrong with a stated rotor inertia the base parameters make up for,
    and their covariance holds it.
    """
    A = dynamics.regressor(model.robot, q, qd, qdd)
    rows = A if "rigid bodies" in parts else np.zeros_like(A)
    scatter, stated = (
        np.einsum("...k,kl,...l->...", rows, V, rows, optimize=True).clip(0.0)
        for V in (model.scatter_covariance, model.drive_covariance)
    )
    variances = np.diag(model.scatter_covariance)
    degrees = combined_degrees(rows, variances, model.degrees_of_freedom)
    if "friction" in parts:
        load = A @ model.values
        law = known_friction(model)
        stated = stated + friction_variance(model.robot, law, q, qd, load, warmth)
    if of_samples:
        stated = stated + np.nan_to_num(model.residual) ** 2
    half = half_width(scatter, stated, degrees, level)
    if "friction" in parts:
        half[..., [axis - 1 for axis in model.axes_without_friction]] = np.nan
    return half


def known_friction(model: IdentifiedRobot, *, of_all: bool = False) -> FrictionLaw:
    """Law of friction of a model.

    Raises
    ------
    NotEnoughData
        It has none; or, where it must be `of_all` axes, none of some.
    """
    law = model.friction_law
    if law is None:
        raise NotEnoughData(
            f"the model of {model.robot.name} has no law of friction: take parts={PARTS[:2]}, or"
            " identify the run anew with: hil identify"
        )
    if law.unknown and (of_all or len(law.unknown) == len(law.axes)):
        raise NotEnoughData(f"the model of {model.robot.name}: {lacking(model)}")
    return law


def lacking(model: IdentifiedRobot) -> str:
    """State which axes have no law of friction, why, and the remedy; empty where all have one."""
    axes = model.axes_without_friction
    if model.friction_law is None or not axes:
        return ""
    return (
        f"no law of friction of axis {', '.join(map(str, axes))}, which fewer than {FOR_A_LAW}"
        " measurements moved: measure it more often (hil plan --refine RUN) and identify both runs"
        " together (hil identify RUN --with MORE)"
    )
