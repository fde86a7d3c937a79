"""Models of robots whose base parameters belong to bodies with positive masses."""

import numpy as np

from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.model.base_parameters import base_parameters
from hil.model.frames import body_parameters
from hil.results.model import Model
from hil.results.provenance import Provenance

RELATIVE_ERROR = 0.05


def bodies(n, seed):
    """Return standard parameters of one cloud of eight masses per link."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(n):
        places = rng.normal(size=3) * 0.2 + rng.normal(size=(8, 3)) * 0.1
        points = np.column_stack([places, np.ones(8)])
        found.append(body_parameters((points.T * rng.uniform(0.5, 3.0, 8)) @ points))
    return np.array(found)


def possible(robot, seed=0):
    """Return base parameters of bodies with positive masses, and standard errors."""
    added = np.full(len(robot.added_parameters), 0.05)
    p = base_parameters(robot).matrix @ np.concatenate(
        [bodies(robot.n_joints, seed).ravel(), added]
    )
    return p, RELATIVE_ERROR * np.maximum(np.abs(p), 0.02)


def model_of(robot, p, error, *, friction=True):
    """Return a model with these values, with Coulomb and viscous friction of all axes."""
    n = len(p)
    provenance = Provenance(
        robot=robot.name, robot_digest=robot.digest, plan_digest="", measured="", bus="",
        measurements=1, left_out=(), identified="2026-01-02T03:04:05Z", method="improved",
        version="0",
    )  # fmt: skip
    return Model(
        robot=robot, method="improved", values=p, scatter_covariance=np.diag(error**2),
        drive_covariance=np.zeros((n, n)), degrees_of_freedom=np.full(n, 50.0),
        residual=np.full(robot.n_joints, 0.1), condition={"all": 1.0}, provenance=provenance,
        friction_law=_law(robot) if friction else FrictionLaw.absent(robot.n_joints),
    )  # fmt: skip


def _law(robot):
    terms = {
        "Coulomb": TermValue(value=3.0, standard_error=0.1),
        "viscous": TermValue(value=1.0, standard_error=0.1),
    }
    law = AxisLaw(law="classical", speed=2.0, terms=terms, plain=terms, held_out={})
    return FrictionLaw(axes=(law,) * robot.n_joints)
