"""Model as data files: JSON of model, friction and samples, and YAML for ros2_control.

Everything is in SI units on the joint side. The symbols are those of the documentation: torques are
A(q, qd, qdd) p, with the base parameters p listed here, plus the torques of the rotor inertias and
of friction. The friction file contains the law of each axis, its curve, and its approximations for
simulators.

Controllers and nodes load the YAML parameters unchanged. Node `joint_dynamics` is for gravity and
friction compensation, with one list entry per joint under plain names. `joint_limits` has the
format that joint_limits of ros2_control reads. The gravity torque itself needs the bodies: those of
the URDF of the same model, or the code from `--to c`. Format references: control.ros.org,
docs.ros.org (parameter files).

Samples are values for domain randomisation in simulators: draws from the joint normal distribution
of base parameters and friction terms. The links are the bodies nearest to the drawn base parameters
(`hil.estimation.consistent`); parameters without effect on torques stay near the model's own
bodies. Friction is simplified as in the other formats (`hil.export.simple_friction`).
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
import yaml

from checked_files.yaml_text import comment
from hil.errors import NotRealisable
from hil.estimation.consistent.conditions import BodyBounds
from hil.estimation.consistent.nearest import nearest_robot
from hil.export.exported import Exported
from hil.export.mjcf_file import FULL
from hil.export.simple_friction import (
    friction_of_joints,
    friction_remarks,
    misfits,
    simple_friction,
)
from hil.export.simulated_robot import simulated_robot
from hil.friction.direction import STILL
from hil.friction.law import TermValue
from hil.friction.terms import DIRECTED, OF_SPEED
from hil.friction.warmth import REFERENCE
from hil.model.base_parameters import base_parameters
from hil.results.identified_robot import friction_alone, known_friction

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.consistent.result import ConsistentRobot
    from hil.export.simple_friction import SimpleFriction
    from hil.export.simulated_robot import SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.friction.law import AxisLaw
    from hil.results.model import Model


def write_json(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as `model.json`."""
    robot, law = model.robot, model.friction_law
    base = base_parameters(robot)
    rows = zip(base.names, base.expressions, base.units, base.heads, strict=True)
    tree = [] if robot.is_chain else ["gamma", "b"]
    frame = (*tree, "alpha", "d", "theta", "r")
    content = {
        "origin": list(origin),
        "robot": robot.name,
        "gravity_m_per_s2": robot.gravity.tolist(),
        "joints": [
            {
                "joint": axis + 1,
                "type": "revolute" if robot.revolute[axis] else "prismatic",
                "position_unit": robot.position_unit(axis),
                "torque_unit": robot.torque_unit(axis),
                **({"parent": robot.parents[axis] + 1} if tree else {}),
                "frame": {name: float(getattr(robot, name)[axis]) for name in frame},
                "reflected_inertia": float(robot.reflected_inertia[axis]),
                "residual": None if np.isnan(residual) else float(residual),
            }
            for axis, residual in enumerate(model.residual)
        ],
        "base_parameters": [
            {
                "name": name,
                "expression": expression,
                "unit": unit,
                "head": head,
                "value": float(model.values[k]),
                "standard_error": float(model.standard_errors[k]),
            }
            for k, (name, expression, unit, head) in enumerate(rows)
        ],
        "covariance": model.covariance.tolist(),
        "friction": law.model_dump(mode="json") if law.known else None,
    }
    return Exported({"model.json": json.dumps(content, indent=2, allow_nan=False) + "\n"})


FORMULAS = {name: term.formula for name, term in OF_SPEED.items()}
"""Factor of the coefficient of each term, as a formula; u is the velocity divided by `speed`."""
TAKEN = {
    "u": "v over the axis's speed, with |v| clipped to the range of `speeds`, if not null",
    "sgn(v)": f"0 where |v| is below {STILL} of the axis's speed",
    "beyond its speeds": "slope_beyond (|v| - clipped |v|) sgn(v) is added",
    "presliding": "after a reversal z replaces sgn(v), with dz/dq = (1 - z sgn(v)) / x over the "
    "axis's presliding_distance x; x = 0: at once. The sum of the directed terms "
    "and of slope_beyond is then clipped to its size at |v| in a constant direction",
    "directed": ", ".join(DIRECTED),
}
"""Rules for evaluating the formulas."""
WARMTH = {
    "level": "the directed terms (those that change their sign with v) times 1 + slope (clip(w, "
    "seen) - reference); w is the warmth, from 0 cold to 1 warm, reference the warmth "
    "at which the terms hold",
    "state": f"dw/dt = (1 - w) x / ({REFERENCE} warming) - w / cooling, with x = |v| over the"
    " velocity limit; w = 0 for a rested axis",
    "directed": list(DIRECTED),
}
"""Meaning of the keys of `warmth` of an axis."""


def write_friction(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the friction of the axes as `friction.json`.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """
    law, simple = known_friction(model), simple_friction(model)
    ends = list(zip(simple_friction(model, 0.0), simple_friction(model, 1.0), strict=True))
    known = [own for own in law.axes if own is not None]
    axes = []
    for own, each, (cold, warm) in zip(known, simple, ends, strict=True):
        warmth: dict[str, object] | None = None
        if own.warmth is not None:
            warmth = own.warmth.model_dump(mode="json")
            warmth["cold"] = {"factor": own.warmth.cold} | _simplified(cold)
            warmth["warm"] = {"factor": own.warmth.warm} | _simplified(warm)
        axes.append(
            {
                "axis": each.axis + 1,
                "torque_unit": model.robot.torque_unit(each.axis),
                "velocity_unit": f"{model.robot.position_unit(each.axis)}/s",
                "law": own.law,
                "speed": own.speed,
                "speeds": own.speeds,
                "slope_beyond": own.slope,
                "presliding_distance": own.presliding,
                "terms": {name: value.model_dump() for name, value in own.terms.items()},
                "level_wandered_by_share": own.wander,
                "curve": {
                    "velocity": each.speeds.tolist(),
                    "forward": each.forward.tolist(),
                    "backward": each.backward.tolist(),
                    "standard_error": friction_alone(model, each.axis, each.speeds)[1].tolist(),
                },
                **_simplified(each),
                "warmth": warmth,
            }
        )
    content = {
        "origin": list(origin),
        "robot": model.robot.name,
        "formulas": FORMULAS | {"cosine k, sine k": "of k times the motor's angle"},
        "taken": TAKEN,
        "axes": axes,
        "unknown": list(law.unknown),
        "warmth": WARMTH,
        "coupled": [each.model_dump(mode="json") for each in law.coupled],
    }
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    warmed = [k for k, own in enumerate(known) if own.warmth is not None]
    said = misfits(model, simple)
    for end, name in enumerate((", cold", ", warm")):
        said += misfits(model, tuple(ends[k][end] for k in warmed), name)
    return Exported({"friction.json": text}, tuple(said))


def _simplified(simple: SimpleFriction) -> dict[str, object]:
    """Return the friction parameters of simulators, with the misfit of each approximation."""
    longer = {"velocity": "stribeck_velocity", "misfit": "misfit_rms"}
    stribeck = {longer.get(key, key): x for key, x in simple.stribeck._asdict().items()}
    return {"coulomb_and_viscous": _plain(simple), "stribeck": stribeck}


def _plain(simple: SimpleFriction) -> dict[str, object]:
    return {"coulomb": simple.coulomb, "viscous": simple.viscous, "misfit_rms": simple.misfit}


NOTES = (
    "joint side, SI: N m, N m s/rad, kg m2; for prismatic joints N, N s/m, kg",
    "joints are named joint1, joint2, ...: rename them after your URDF, in the same order",
    "torque to command = rigid bodies + armature * acceleration + friction below; armature is "
    "the rotor inertia of the robot file; an identified rotor inertia is part of the rigid bodies",
    "static friction and the Stribeck velocity replace coulomb and viscous in a controller with "
    "a Stribeck curve; do not add both",
    "over-compensated Coulomb friction makes a joint creep or oscillate: begin with half of it, and"
    " blend it in over a velocity a few times the noise of your velocity signal",
    "an effort interface takes these torques; with a current interface divide by torque_constant"
    " times gear_ratio",
)


def write_ros2(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as `NAME.ros2.yaml`."""
    robot, names, dynamics = model.robot, [], {}
    for axis, friction in enumerate(friction_of_joints(model)):
        names.append(f"joint{axis + 1}")
        found: dict[str, object] = {"armature": float(robot.reflected_inertia[axis])}
        for key in ("gear_ratio", "torque_constant"):
            value = float(getattr(robot, key)[axis])
            if np.isfinite(value):
                found[key] = value
        if friction is not None:
            stribeck = friction.stribeck._asdict()
            del stribeck["misfit"]
            found["friction"] = {**_plain(friction), "stribeck": stribeck}
        dynamics[names[-1]] = found
    content = {
        "joint_dynamics": {
            "ros__parameters": {
                "joints": names,
                "gravity": [float(x) for x in robot.gravity],
                **dynamics,
            }
        },
        "joint_limits": {
            "ros__parameters": {
                "joint_limits": {name: _limits(model, k) for k, name in enumerate(names)}
            }
        },
    }
    remarks = friction_remarks(model)
    head = "".join(f"{comment(line)}\n" for line in (*origin, *NOTES, *remarks))
    text = head + yaml.safe_dump(content, sort_keys=False)
    return Exported({f"{robot.name}.ros2.yaml": text}, remarks)


def _limits(model: Model, axis: int) -> dict[str, object]:
    """Return the limits of a joint under the names of ros2_control, with flags for known limits."""
    robot = model.robot
    found: dict[str, object] = {
        "has_position_limits": True,
        "min_position": float(robot.q_min[axis]),
        "max_position": float(robot.q_max[axis]),
    }
    for name, values in (
        ("velocity", robot.velocity_limit),
        ("acceleration", robot.acceleration_limit),
        ("effort", robot.torque_limit),
    ):
        known = bool(np.isfinite(values[axis]))
        found[f"has_{name}_limits"] = known
        if known:
            found[f"max_{name}"] = float(values[axis])
    return found


SAMPLES = 50
"""Number of samples."""
HEAVIER = 1.5
"""Largest ratio of a link's mass to that of the model's own body: torques determine few masses."""
SEED = 1


def write_ranges(model: Model, origin: tuple[str, ...], given: Given | None = None) -> Exported:
    """Return samples of a model with bodies as `NAME.ranges.json`."""
    chain, rng = None if given is None else given.chain, np.random.default_rng(SEED)
    first, kept = simulated_robot(model, chain), cast("ConsistentRobot", model.consistent)
    masses = {
        link: (mass / HEAVIER, mass * HEAVIER) for link, mass in enumerate(kept.bodies[:, 9], 1)
    }
    bounds, samples, unbounded = BodyBounds(thickness=kept.thickness, masses=masses), [], 0
    for _ in range(SAMPLES):
        one = draw(model, rng)
        try:
            bodies = nearest_robot(model.robot, one.values, model.covariance, bounds, kept.bodies)
        except NotRealisable:  # the model's own bodies are extreme
            bodies = nearest_robot(model.robot, one.values, model.covariance)
            unbounded += 1
        samples.append(_values(simulated_robot(replace(one, consistent=bodies), chain)))
    remarks = friction_remarks(model, offsets='in the file as "offset"')
    if unbounded:
        remarks += (
            f"{unbounded} of {SAMPLES} samples have no physically consistent links with "
            f"{1 / HEAVIER:.2g} to {HEAVIER:g} times the model's masses: masses of typical "
            "links are used instead",
        )
    content = {
        "origin": [*origin, *remarks],
        "joints": [joint.name for joint in first.joints],
        "links": [joint.link for joint in first.joints],
        "model": _values(first),
        "samples": samples,
    }
    text = json.dumps(content, allow_nan=False) + "\n"
    return Exported({f"{model.robot.name}.ranges.json": text}, remarks)


def _values(robot: SimulatedRobot) -> dict[str, list[object]]:
    """Return the values of the joints, inertias about the centre in the order of `FULL`."""
    friction = [joint.friction for joint in robot.joints]
    return {
        "mass": [joint.mass for joint in robot.joints],
        "centre": [joint.centre.tolist() for joint in robot.joints],
        "fullinertia": [[float(joint.inertia[at]) for at in FULL] for joint in robot.joints],
        "armature": [joint.armature for joint in robot.joints],
        "damping": [each and each.viscous for each in friction],
        "frictionloss": [each and each.coulomb for each in friction],
        "offset": [each and each.offset for each in friction],
    }


def draw(model: Model, rng: np.random.Generator) -> Model:
    """Draw base parameters and friction of axes from their joint distribution."""
    change = _root(model.covariance) @ rng.standard_normal(len(model.values))
    weights = np.asarray(np.linalg.pinv(model.covariance, 1e-10, hermitian=True), dtype=float)
    axes: list[AxisLaw | None] = []
    for each in model.friction_law.axes:
        axes.append(each)
        if each is None:
            continue
        # given the change of the base parameters
        V, mean = each.uncertainty, each.values
        if each.beside:
            shared = np.array(each.beside)
            mean = mean + shared @ weights @ change
            V = V - shared @ weights @ shared.T
        values = mean + _root(V) @ rng.standard_normal(len(mean))
        terms = TermValue.named(each.terms, values, each.uncertainty)
        axes[-1] = each.model_copy(update={"terms": terms})
    law = model.friction_law.model_copy(update={"axes": tuple(axes)})
    return replace(model, values=model.values + change, friction_law=law)


def _root(V: Array) -> Array:
    """Return a square root of a covariance; variances below zero from rounding count as zero."""
    values, vectors = np.linalg.eigh(V)
    return np.asarray(vectors * np.sqrt(values.clip(0.0)))
