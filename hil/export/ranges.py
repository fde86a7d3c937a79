"""Samples of a model's uncertainty as JSON: values for domain randomisation in simulators.

A sample is drawn from the joint normal distribution of base parameters and friction terms. Its
links are the bodies nearest to the drawn base parameters (`hil.estimation.consistent`), so every
sample is physically consistent; parameters without effect on torques stay near the model's own
bodies. Friction is simplified as in the other formats of simulators (`hil.export.simple_friction`).
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from hil.errors import NotRealisable
from hil.estimation.consistent.conditions import BodyBounds
from hil.estimation.consistent.nearest import nearest_robot
from hil.export.exported import Exported
from hil.export.mjcf_file import FULL
from hil.export.simple_friction import friction_remarks
from hil.export.simulated_robot import simulated_robot
from hil.friction.law import TermValue

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.consistent.result import ConsistentRobot
    from hil.export.simulated_robot import SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.friction.law import AxisLaw
    from hil.results.model import Model

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
    """Return the values of all joints, inertias about the centre in the order of `FULL`."""
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
    axes = tuple(each and _draw(each, weights, change, rng) for each in model.friction_law.axes)
    law = model.friction_law.model_copy(update={"axes": axes})
    return replace(model, values=model.values + change, friction_law=law)


def _draw(law: AxisLaw, weights: Array, change: Array, rng: np.random.Generator) -> AxisLaw:
    """Draw an axis's terms, given the change of the base parameters."""
    V, mean = law.uncertainty, law.values
    if law.beside:
        shared = np.array(law.beside)
        mean = mean + shared @ weights @ change
        V = V - shared @ weights @ shared.T
    values = mean + _root(V) @ rng.standard_normal(len(mean))
    terms = TermValue.named(law.terms, values, law.uncertainty)
    return law.model_copy(update={"terms": terms})


def _root(V: Array) -> Array:
    """Return a square root of a covariance; variances below zero from rounding count as zero."""
    values, vectors = np.linalg.eigh(V)
    return np.asarray(vectors * np.sqrt(values.clip(0.0)))
