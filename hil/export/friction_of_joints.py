"""Friction of the joints of a simulated robot; a model without is exported without, and says so."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import NotEnoughData
from hil.export.friction_file import misfits, presliding_left_out
from hil.export.simple_friction import simple_friction

if TYPE_CHECKING:
    from hil.export.simple_friction import SimpleFriction
    from hil.results.model import Model


def friction_of_joints(model: Model) -> tuple[SimpleFriction | None, ...]:
    """Friction of each joint; None where the model has no law of it."""
    try:
        found = {each.axis: each for each in simple_friction(model)}
    except NotEnoughData:
        found = {}
    return tuple(found.get(axis) for axis in range(model.robot.n_joints))


def friction_remarks(model: Model) -> tuple[str, ...]:
    """What Coulomb's and viscous friction are off by, or why there is none."""
    try:
        found = misfits(model, simple_friction(model))
    except NotEnoughData:
        return (
            "no friction is stated, since the model has no law of it: identify a run anew that"
            " moves all axes (hil identify)",
        )
    return (*found, *presliding_left_out(model))
