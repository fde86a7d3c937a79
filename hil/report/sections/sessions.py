"""Where and on what it was measured, session by session."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.section import Section
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.runs.journal import Session


def section(run: ReportedRun) -> Section:
    """Sessions with their axes, and digests of robot file and plan."""
    sessions = [(each, _axes(each, run.robot)) for each in run.source.journal.sessions]
    values = {"sessions": sessions, "robot": run.robot, "plan": run.source.plan}
    return Section("Sessions and drives", "sessions.html", values)


def _axes(session: Session, robot: Robot) -> Table:
    rows = (
        (
            axis.name,
            axis.identity,
            f"{axis.torque_resolution:.3g}",
            f"{axis.position_resolution:.3g}",
        )
        for axis in session.axes
    )
    return Table(
        title="",
        columns=(
            Column("axis"),
            Column("drive", folds=True),
            *figures(
                f"torque resolution, {robot.torque_units}",
                f"position resolution, {robot.position_units}",
            ),
        ),
        parts=(Part(tuple(rows)),),
    )
