"""What `hil diagnose` found that the robot file leaves out, with the paper's Fig. 7."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.report.kept_result import current
from hil.report.plots.diagnosis import shifted_sinusoid
from hil.report.section import Plot, Section
from hil.results.diagnosis_file import NAME, load_diagnosis
from hil.results.tables import diagnosis as tables

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.report.reported_run import IdentifiedRun
    from hil.results.diagnosis_file import DiagnosisFile

PHASE = (
    "Where what was found shifts a gravity torque most (the paper's Fig. 7): sinusoids at the"
    " measured configuration where the stated one is largest. Measurements at other configurations"
    " are brought to this one by the extended model, and what is the same in all of them is taken"
    " off."
)


def section(run: IdentifiedRun) -> Section | None:
    """What is kept of a diagnosis, or why it is not shown."""
    found, note = current(load_diagnosis, run, NAME, f"hil diagnose {run.source.path}")
    if found is None and not note:
        return None
    values = {"found": found, "note": note, "tables": tables}
    plots = _plots(found, run.robot) if found else ()
    return Section("Parameters absent from the robot file", "diagnosis.html", values, plots)


def _plots(found: DiagnosisFile, robot: Robot) -> tuple[Plot, ...]:
    if found.phase is None:
        return ()
    return (
        Plot(
            "phase",
            partial(shifted_sinusoid, found.phase.phase(), ", ".join(found.found), robot),
            "A gravity torque over a joint angle: sinusoids of the robot file and with what was"
            " found, and measurements.",
            PHASE,
        ),
    )
