"""The nearest robot that consists of bodies, where `hil identify --consistent` found one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.kept_result import kept_model
from hil.report.section import Section
from hil.results.tables.consistent import bodies, changed_parameters, torque_costs

if TYPE_CHECKING:
    from hil.report.reported_run import ForeignRun, IdentifiedRun


def section(run: IdentifiedRun | ForeignRun) -> Section | None:
    """Bodies that the kept model has, as long as it is the one of this report."""
    kept = kept_model(run)
    if kept is None or kept.consistent is None:
        return None
    found = kept.consistent
    return Section(
        "Bodies",
        "bodies.html",
        {
            "bodies": bodies(run.robot, found),
            "changed": changed_parameters(run.robot, found),
            "costs": torque_costs(run.robot, found),
        },
    )
