"""Friction as one JSON file: the law of each axis, its curve, and what simulators make of it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.bristles import STILL
from hil.estimation.friction.warmth import REFERENCE
from hil.estimation.friction_law import DIRECTED, friction_variance
from hil.export.exported import Exported
from hil.export.simple_friction import misfits, simple_friction
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
TAKEN = {
    "u": "v over the axis's speed, with |v| clipped to its speeds where these are not null",
    "sgn(v)": f"0 where |v| is below {STILL} of the axis's speed",
    "beyond its speeds": "slope_beyond (|v| - clipped |v|) sgn(v) is added",
    "presliding": "after a reversal sgn(v) turns round over the axis's presliding_distance x as"
    " dz/dq = (1 - z sgn(v)) / x; 0: at once",
}
"""How the formulas are to be taken."""
WARMTH = {
    "level": "the directed terms, all that change their sign with v, times 1 + slope (clip(w, seen)"
    " - reference); w is the warmth, from 0 cold to 1 warm, and reference that of the terms",
    "state": f"dw/dt = (1 - w) x / ({REFERENCE} warming) - w / cooling, with x = |v| over the"
    " velocity limit; w = 0 for a rested axis",
    "directed": list(DIRECTED),
}
"""What `warmth` of an axis means."""


def write_friction(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the friction of all axes as `friction.json`.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    law, simple = known_friction(model), simple_friction(model)
    ends = list(zip(simple_friction(model, 0.0), simple_friction(model, 1.0), strict=True))
    known = [own for own in law.axes if own is not None]
    content = {
        "origin": list(origin),
        "robot": model.robot.name,
        "formulas": FORMULAS | {"cosine k, sine k": "of k times the motor's angle"},
        "taken": TAKEN,
        "axes": [
            _axis(model, own, each) | _warmth(own, *cold_and_warm)
            for own, each, cold_and_warm in zip(known, simple, ends, strict=True)
        ],
        "unknown": list(law.unknown),
        "warmth": WARMTH,
        "coupled": [each.model_dump(mode="json") for each in law.coupled],
    }
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    warm = [k for k, own in enumerate(known) if own.warmth is not None]
    said = misfits(model, simple)
    for end, name in enumerate((", cold", ", warm")):
        said += misfits(model, tuple(ends[k][end] for k in warm), name)
    return Exported({"friction.json": text}, tuple(said))


def _axis(model: Model, law: AxisLaw, simple: SimpleFriction) -> dict[str, object]:
    axis = simple.axis
    return {
        "axis": axis + 1,
        "torque_unit": model.robot.torque_unit(axis),
        "velocity_unit": f"{model.robot.position_unit(axis)}/s",
        "law": law.law,
        "speed": law.speed,
        "speeds": law.speeds,
        "slope_beyond": law.slope,
        "presliding_distance": law.presliding,
        "terms": {name: value.model_dump() for name, value in law.terms.items()},
        "level_wandered_by_share": law.wander,
        "curve": {
            "velocity": simple.speeds.tolist(),
            "forward": simple.forward.tolist(),
            "backward": simple.backward.tolist(),
            "standard_error": _errors(model, simple).tolist(),
        },
        **_simplified(simple),
    }


def _warmth(law: AxisLaw, cold: SimpleFriction, warm: SimpleFriction) -> dict[str, object]:
    """What warmth does to an axis's friction: null where it is not identified."""
    own = law.warmth
    if own is None:
        return {"warmth": None}
    ends = {"cold": (own.cold, cold), "warm": (own.warm, warm)}
    return {
        "warmth": own.model_dump(mode="json")
        | {name: {"factor": factor} | _simplified(each) for name, (factor, each) in ends.items()}
    }


def _simplified(simple: SimpleFriction) -> dict[str, object]:
    """Friction in the terms of simulators, with the misfit of each simplification."""
    stribeck = simple.stribeck
    return {
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
