"""Friction as one JSON file: the law of each axis, its curve, and what simulators make of it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.friction_law import friction_variance
from hil.export.exported import Exported
from hil.export.simple_friction import simple_friction
from hil.results.rounding import percent, significant
from hil.results.torque_parts import known_friction

if TYPE_CHECKING:
    from hil.estimation.friction_law import AxisLaw
    from hil.export.simple_friction import SimpleFriction
    from hil.results.model import Model

FORMULAS = {
    "offset": "1",
    "Coulomb": "sgn(v)",
    "viscous": "u",
    "asymmetric": "|u|",
    "cube root": "cbrt(u)",
    "arc tangent": "atan(u / 0.08)",
    "quadratic": "u |u|",
    "load": "|load| sgn(v)",
}
"""What the coefficient of each term is multiplied by; u is the velocity over `speed`."""


def write_friction(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the friction of all axes as `friction.json`.

    Raises
    ------
    NotEnoughData
        The model has no law of friction, or none of some axes.
    """
    law, simple = known_friction(model), simple_friction(model)
    content = {
        "origin": list(origin),
        "robot": model.robot.name,
        "formulas": FORMULAS | {"cosine k, sine k": "of k times the motor's angle"},
        "axes": [
            _axis(model, own, each)
            for own, each in zip(law.axes, simple, strict=True)
            if own is not None
        ],
        "coupled": [each.model_dump(mode="json") for each in law.coupled],
    }
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    return Exported({"friction.json": text}, tuple(misfits(model, simple)))


def misfits(model: Model, simple: tuple[SimpleFriction, ...]) -> list[str]:
    """What the simplest simplification costs, axis by axis."""
    return [
        f"axis {each.axis + 1}: Coulomb {significant(each.coulomb, 3)} and viscous"
        f" {significant(each.viscous, 3)} {model.robot.torque_unit(each.axis)}"
        f" s/{model.robot.position_unit(each.axis)} miss the law by"
        f" {significant(each.misfit, 2)} {model.robot.torque_unit(each.axis)} rms"
        f" ({percent(each.misfit, each.size)} % of it)"
        for each in simple
    ]


def _axis(model: Model, law: AxisLaw, simple: SimpleFriction) -> dict[str, object]:
    axis, stribeck = simple.axis, simple.stribeck
    return {
        "axis": axis + 1,
        "torque_unit": model.robot.torque_unit(axis),
        "velocity_unit": f"{model.robot.position_unit(axis)}/s",
        "law": law.law,
        "speed": law.speed,
        "terms": {name: value.model_dump() for name, value in law.terms.items()},
        "level_wandered_by_share": law.wander,
        "curve": {
            "velocity": simple.speeds.tolist(),
            "forward": simple.forward.tolist(),
            "backward": simple.backward.tolist(),
            "standard_error": _errors(model, simple).tolist(),
        },
        "coulomb_and_viscous": {
            "coulomb": simple.coulomb,
            "viscous": simple.viscous,
            "misfit_rms": simple.misfit,
        },
        "stribeck": {
            "coulomb": stribeck.coulomb,
            "static": stribeck.static,
            "viscous": stribeck.viscous,
            "stribeck_velocity": stribeck.velocity,
            "misfit_rms": stribeck.misfit,
        },
    }


def _errors(model: Model, simple: SimpleFriction) -> np.ndarray:
    """Standard errors of the curve forward, of terms and of the level's wandering."""
    qd = np.zeros((len(simple.speeds), model.robot.n_joints))
    qd[:, simple.axis] = simple.speeds
    still = np.zeros_like(qd)
    variance = friction_variance(model.robot, known_friction(model), still, qd, still)
    return np.asarray(np.sqrt(variance[:, simple.axis]))
