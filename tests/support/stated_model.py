"""Models of any robot with stated values: random base parameters, all friction terms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.friction.law import AxisLaw, CoupledFriction, FrictionLaw, TermValue
from hil.friction.terms import CLASSICAL, LAWS
from hil.friction.warmth import Warmth
from hil.model.base_parameters import base_parameters
from hil.results.model import Model
from hil.results.provenance import Provenance

if TYPE_CHECKING:
    from collections.abc import Collection

    from hil.model.robot import Robot


def stated_model(
    robot: Robot, seed: int = 0, *, friction: Collection[str] = LAWS["all"], warm: bool = False
) -> Model:
    """Return a model as from identification, with the terms in `friction` (default: all).

    With `warm`, friction of all axes but the last depends on the axis's warmth.
    """
    rng = np.random.default_rng(seed)
    n = len(base_parameters(robot))
    return Model(
        robot=robot,
        method="improved",
        values=rng.uniform(-2.0, 2.0, n),
        scatter_covariance=1e-4 * np.eye(n),
        drive_covariance=np.zeros((n, n)),
        degrees_of_freedom=np.full(n, 20.0),
        residual=np.full(robot.n_joints, 0.1),
        condition={"all": 10.0},
        provenance=Provenance(
            robot=robot.name,
            robot_digest=robot.digest,
            plan_digest="0" * 64,
            measured="",
            bus="",
            measurements=1,
            left_out=(),
            identified="2026-01-02T03:04:05Z",
            method="improved",
            version="0",
        ),
        friction_law=_law(robot, rng, friction, warm=warm)
        if friction
        else FrictionLaw.absent(robot.n_joints),
    )


WARMTH = Warmth(
    warming=20.0, cooling=200.0, slope=-0.3, slope_error=0.02, reference=0.4, seen=(0.1, 0.8),
    wander=0.01, over_law=1.5, over_last=1.4,
)  # fmt: skip


def _law(
    robot: Robot, rng: np.random.Generator, terms: Collection[str], *, warm: bool
) -> FrictionLaw:
    def value() -> TermValue:
        return TermValue(value=float(rng.uniform(0.2, 2.0)), standard_error=0.01)

    axes = [
        AxisLaw(
            law="all",
            speed=2.0,
            terms={term: value() for term in terms},
            plain={term: value() for term in CLASSICAL},
            held_out={},
            wander=0.03,
            speeds=(0.1, 2.0),
            warmth=WARMTH if warm and axis + 1 < robot.n_joints else None,
        )
        for axis in range(robot.n_joints)
    ]
    coupled = [
        CoupledFriction(motor=m + 1, joint=j + 1, viscous=value(), coulomb=value())
        for m, j, _ in robot.couplings
    ]
    return FrictionLaw(axes=tuple(axes), coupled=tuple(coupled))
