"""The parts of the torque of a drive, and what a model knows of its friction.

    Q = A(q, qd, qdd) p + H qdd + F(q, qd, A p)

Rigid bodies, motors, eq. (6) and (7), and friction (`hil.results.model.Model.torque`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import NotEnoughData
from hil.planning.measurement import FOR_A_LAW

if TYPE_CHECKING:
    from hil.friction.law import FrictionLaw
    from hil.results.identified_robot import IdentifiedRobot

PARTS = ("rigid bodies", "motors", "friction")
"""Of the torque that a drive gives; gravity alone is `hil.results.model.Model.gravity`."""


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
