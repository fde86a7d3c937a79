"""Samples of a model's uncertainty as JSON: values for domain randomisation in simulators.

A sample is drawn from the joint normal distribution of base parameters and friction terms, in which
both are correlated where one regression found both. Its links are the bodies nearest to the drawn
base parameters (`hil.estimation.consistent`), so every sample is physically consistent; what no
torque depends on stays as near to the model's own bodies as that allows. Friction is simplified as
in the formats of simulators (`hil.export.simple_friction`).
"""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

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
    from hil.export.simulated_robot import SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.friction.law import AxisLaw
    from hil.results.model import Model

SAMPLES = 50
"""Number of samples."""
HEAVIER = 1.5
"""Bound on a link's mass over that of the model's own body: torques decide few masses."""
SEED = 1


def write_ranges(model: Model, origin: tuple[str, ...], given: Given | None = None) -> Exported:
    """Return samples of a model with bodies as `NAME.ranges.json`."""
    chain, rng = None if given is None else given.chain, np.random.default_rng(SEED)
    first, kept = simulated_robot(model, chain), model.consistent
    assert kept is not None  # noqa: S101 - simulated_robot refuses a model without bodies
    masses = {
        link: (mass / HEAVIER, mass * HEAVIER) for link, mass in enumerate(kept.bodies[:, 9], 1)
    }
    bounds, samples = BodyBounds(thickness=kept.thickness, masses=masses), []
    for _ in range(SAMPLES):
        one = drawn(model, rng)
        try:
            bodies = nearest_robot(model.robot, one.values, model.covariance, bounds, kept.bodies)
        except NotRealisable:  # no such masses: those that the drawn parameters ask for
            bodies = nearest_robot(model.robot, one.values, model.covariance, likely=kept.bodies)
        samples.append(_values(simulated_robot(replace(one, consistent=bodies), chain)))
    remarks = friction_remarks(model, offsets='in the file as "offset"')
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
    """Values of all joints: inertia about the centre, as MuJoCo's fullinertia orders it."""
    return {
        "mass": [joint.mass for joint in robot.joints],
        "centre": [joint.centre.tolist() for joint in robot.joints],
        "fullinertia": [[float(joint.inertia[at]) for at in FULL] for joint in robot.joints],
        "armature": [joint.armature for joint in robot.joints],
        "damping": [f and f.viscous for f in (joint.friction for joint in robot.joints)],
        "frictionloss": [f and f.coulomb for f in (joint.friction for joint in robot.joints)],
        "offset": [f and f.offset for f in (joint.friction for joint in robot.joints)],
    }


def drawn(model: Model, rng: np.random.Generator) -> Model:
    """Return the model with base parameters and friction drawn from their distribution."""
    change = _root(model.covariance) @ rng.standard_normal(len(model.values))
    law = model.friction_law
    if law is not None:
        weights = np.linalg.pinv(model.covariance, rcond=1e-10, hermitian=True)
        axes = [each and _drawn(each, weights, change, rng) for each in law.axes]
        law = law.model_copy(update={"axes": tuple(axes)})
    return replace(model, values=model.values + change, friction_law=law)


def _drawn(law: AxisLaw, weights: Array, change: Array, rng: np.random.Generator) -> AxisLaw:
    """Draw an axis's terms, given the change of the base parameters."""
    V, mean = law.uncertainty, law.values
    if law.beside:
        shared = np.array(law.beside)
        mean = mean + shared @ weights @ change
        V = V - shared @ weights @ shared.T
    values = mean + _root(V) @ rng.standard_normal(len(mean))
    pairs = zip(law.terms.items(), values.tolist(), strict=True)
    terms = {
        name: TermValue(value=value, standard_error=term.standard_error)
        for (name, term), value in pairs
    }
    return law.model_copy(update={"terms": terms})


def _root(covariance: Array) -> Array:
    """Root of a covariance, rounding below zero left out."""
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
