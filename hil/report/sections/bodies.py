"""The nearest robot that consists of bodies, where `hil identify --consistent` found one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import HilError
from hil.report.section import Section
from hil.results.model import Model
from hil.results.model_file import NAME
from hil.results.stamp import same_parameters
from hil.results.tables.consistent import bodies, changed_parameters, torque_costs

if TYPE_CHECKING:
    from hil.report.reported_run import FreeRun, IdentifiedRun


def section(run: IdentifiedRun | FreeRun) -> Section | None:
    """Bodies that the kept model has, as long as it is the one of this report."""
    path = run.source.path / NAME
    if not path.exists():
        return None
    try:
        kept = Model.load(path)
    except HilError:
        return None
    found = kept.consistent
    if found is None or same_parameters(kept.values.tolist(), run.model.values):
        return None
    return Section(
        "Bodies",
        "bodies.html",
        {
            "bodies": bodies(run.robot, found),
            "changed": changed_parameters(run.robot, found),
            "costs": torque_costs(run.robot, found),
        },
    )
