"""Identification of robot dynamics and friction on the machine itself.

::

    run = hil.Run.open("runs/first")
    model = hil.identify(run)
    model.predict(q, qd, qdd)
    fit = hil.regression(run, covariance="CR2").fit()
    fit.conf_int(), fit.torque_parts(recording)

A `Robot` contains prior knowledge, a `Run` the measurements, a `Model` the identified values. The
functions calculate with any base parameters p. All errors are subclasses of `hil.errors.HilError`.

Names are imported at first use, so that ``import hil`` is quick and the program `hil` installs its
signal handlers before heavy modules load. The project's other packages have names that folders of a
laboratory may have too, so their origin is checked first.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hil import errors
    from hil.commands.accept import accept, draft_limits
    from hil.commands.friction import fit_friction
    from hil.ground_truth.comparison import compare
    from hil.imports.importing import import_recordings
    from hil.model.base_parameters import base_parameters
    from hil.model.dynamics import gravity_torque, inverse_dynamics, mass_matrix, regressor
    from hil.model.motors import motor_torque
    from hil.model.robot import Robot, available_robots
    from hil.report.figure import (
        plot_friction,
        plot_friction_over_time,
        plot_parameters,
        plot_torque,
    )
    from hil.report.page import report
    from hil.results.identification import identify
    from hil.results.model import Model
    from hil.results.problem import regression
    from hil.results.validation import validate
    from hil.runs.run import Run
    from hil.simulation.replay import replay
    from hil.tasks.exporting import export
    from hil.tasks.measuring import dry_run, measure
    from hil.tasks.plans import plan
    from hil.version import __version__

__all__ = [
    "Model",
    "Robot",
    "Run",
    "__version__",
    "accept",
    "available_robots",
    "base_parameters",
    "compare",
    "draft_limits",
    "dry_run",
    "errors",
    "export",
    "fit_friction",
    "gravity_torque",
    "identify",
    "import_recordings",
    "inverse_dynamics",
    "mass_matrix",
    "measure",
    "motor_torque",
    "plan",
    "plot_friction",
    "plot_friction_over_time",
    "plot_parameters",
    "plot_torque",
    "regression",
    "regressor",
    "replay",
    "report",
    "validate",
]

_LATER = {
    "__version__": "hil.version",
    "Model": "hil.results.model",
    "Robot": "hil.model.robot",
    "Run": "hil.imports.arrays",
    "accept": "hil.commands.accept",
    "available_robots": "hil.model.robot",
    "base_parameters": "hil.model.base_parameters",
    "compare": "hil.ground_truth.comparison",
    "draft_limits": "hil.commands.accept",
    "dry_run": "hil.tasks.measuring",
    "export": "hil.tasks.exporting",
    "fit_friction": "hil.commands.friction",
    "gravity_torque": "hil.model.dynamics",
    "identify": "hil.results.identification",
    "import_recordings": "hil.imports.importing",
    "inverse_dynamics": "hil.model.dynamics",
    "mass_matrix": "hil.model.dynamics",
    "measure": "hil.tasks.measuring",
    "motor_torque": "hil.model.motors",
    "plan": "hil.tasks.plans",
    "plot_friction": "hil.report.figure",
    "plot_friction_over_time": "hil.report.figure",
    "plot_parameters": "hil.report.figure",
    "plot_torque": "hil.report.figure",
    "regression": "hil.results.problem",
    "regressor": "hil.model.dynamics",
    "replay": "hil.simulation.replay",
    "report": "hil.report.page",
    "validate": "hil.results.validation",
}
_MODULES = ("errors", "export", "report")
"""Modules and packages among the public names; `export` and `report` are callable as functions,
too.
"""


def _refuse_strangers() -> None:
    """Refuse foreign packages with the names of these modules, earlier on the path."""
    ours = Path(__file__).parent.parent
    for name in ("checked_files", "drivers"):
        spec = find_spec(name)
        place = next(iter((spec and spec.submodule_search_locations) or ()), name)
        if Path(place) != ours / name:
            raise ImportError(
                f"{place} shadows the package {name} of hil; rename it, or start Python without "
                "it on sys.path"
            )


_refuse_strangers()


def __getattr__(name: str) -> object:
    if name in _MODULES:
        return import_module(f"hil.{name}")
    if name not in _LATER:
        raise AttributeError(f"module 'hil' has no attribute {name!r}")
    return public(name)


def public(name: str) -> Any:
    """Import a public name from its module."""
    return getattr(import_module(_LATER[name]), name)


def __dir__() -> list[str]:
    return __all__
