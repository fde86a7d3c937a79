"""Identification of robot dynamics and friction on the machine itself.

What needs a compiler or a fit is imported when it is first used, so that ``import hil`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from hil.model.base_parameters import base_parameters
from hil.model.robot import load_robot

if TYPE_CHECKING:
    from hil.model.dynamics import gravity_torque, inverse_dynamics, mass_matrix, regressor
    from hil.results.model_file import identify

__all__ = [
    "base_parameters",
    "gravity_torque",
    "identify",
    "inverse_dynamics",
    "load_robot",
    "mass_matrix",
    "regressor",
]

_LATER = {
    "gravity_torque": "hil.model.dynamics",
    "identify": "hil.results.model_file",
    "inverse_dynamics": "hil.model.dynamics",
    "mass_matrix": "hil.model.dynamics",
    "regressor": "hil.model.dynamics",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module 'hil' has no attribute {name!r}")
    return getattr(import_module(_LATER[name]), name)
