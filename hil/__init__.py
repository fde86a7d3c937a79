"""Identification of robot dynamics and friction on the machine itself.

Everything is imported when it is first used, so that ``import hil`` is quick and the program `hil`
has its signals in hand before anything heavy is loaded.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.model.base_parameters import base_parameters
    from hil.model.dynamics import gravity_torque, inverse_dynamics, mass_matrix, regressor
    from hil.model.robot import load_robot
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
    "base_parameters": "hil.model.base_parameters",
    "gravity_torque": "hil.model.dynamics",
    "identify": "hil.results.model_file",
    "inverse_dynamics": "hil.model.dynamics",
    "load_robot": "hil.model.robot",
    "mass_matrix": "hil.model.dynamics",
    "regressor": "hil.model.dynamics",
}


def __getattr__(name: str) -> object:
    if name not in _LATER:
        raise AttributeError(f"module 'hil' has no attribute {name!r}")
    return getattr(import_module(_LATER[name]), name)
