"""A model as one JSON file: all that a program needs to calculate with it, in SI units.

Everything is on the joint side. The symbols are those of the documentation: torques are
A(q, qd, qdd) p, with the base parameters p listed here, plus those of the motors' own inertia and
of friction. Friction by itself, with its curves, is `hil.export.friction_file`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from hil.export.exported import Exported
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from hil.results.model import Model


def write_json(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as `model.json`."""
    law = model.friction_law
    content = {
        "origin": list(origin),
        "robot": model.robot.name,
        "gravity_m_per_s2": model.robot.gravity.tolist(),
        "joints": [_joint(model, axis) for axis in range(model.robot.n_joints)],
        "base_parameters": _parameters(model),
        "covariance": model.covariance.tolist(),
        "friction": None if law is None else law.model_dump(mode="json"),
    }
    return Exported({"model.json": json.dumps(content, indent=2, allow_nan=False) + "\n"})


def _joint(model: Model, axis: int) -> dict[str, object]:
    """Return frame, unit and drive of a joint (from 0)."""
    robot, residual = model.robot, float(model.residual[axis])
    return {
        "joint": axis + 1,
        "type": "revolute" if robot.revolute[axis] else "prismatic",
        "position_unit": robot.position_unit(axis),
        "torque_unit": robot.torque_unit(axis),
        "frame": {name: float(getattr(robot, name)[axis]) for name in ("alpha", "d", "theta", "r")},
        "reflected_inertia": float(robot.reflected_inertia[axis]),
        "residual": None if np.isnan(residual) else residual,
    }


def _parameters(model: Model) -> list[dict[str, object]]:
    base = base_parameters(model.robot)
    rows = zip(base.names, base.expressions, base.units, base.heads, strict=True)
    return [
        {
            "name": name,
            "expression": expression,
            "unit": unit,
            "head": head,
            "value": float(model.values[k]),
            "standard_error": float(model.standard_errors[k]),
        }
        for k, (name, expression, unit, head) in enumerate(rows)
    ]
