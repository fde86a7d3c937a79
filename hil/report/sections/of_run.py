"""Sections about the run: findings, drive trains, sessions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.tables.parameters import drive_train
from hil.show.section import Section
from hil.show.table import Column, Part, Table, figures, table

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.results.judgement import Reservation
    from hil.runs.journal import Session


def advice(run: ReportedRun) -> Section | None:
    """Create the section of remedies and notes beyond the first sentence."""
    outcome = run.model.verdict
    items = (*(outcome.further if outcome else ()), *run.found.advice)
    if run.source.imported and not items:
        return None
    urgent = [item for item in items if item.word != "good"]
    notes = [item for item in items if item.word == "good"]
    return Section(
        "Findings and remedies",
        "advice.html",
        {"urgent": _findings(urgent), "notes": notes},
    )


def _findings(items: list[Reservation]) -> Table:
    """Tabulate findings by remedy."""
    remedies = dict.fromkeys(item.remedy for item in items)
    parts = (
        Part(
            tuple((e.subject, e.reason) for e in items if e.remedy == each),
            f"Remedy: {each}" if each else "",
        )
        for each in remedies
    )
    return table("", ("where", Column("finding", folds=True)), parts)


def drive_trains(run: ReportedRun) -> Section | None:
    """Create the section of drive trains; None without estimates."""
    axes = drive_train(run.estimate, run.robot)
    if not axes:
        return None
    return Section("Drive trains", "drive_train.html", {"axes": axes})


def sessions(run: ReportedRun) -> Section:
    """Create the section of sessions with axes, and digests of robot file and plan."""
    listed = [(each, _session(each, run.robot)) for each in run.source.journal.sessions]
    values = {"sessions": listed, "robot": run.robot, "plan": run.source.plan}
    return Section("Sessions and drives", "sessions.html", values)


def _session(session: Session, robot: Robot) -> Table:
    units = robot.torque_units, robot.position_units
    resolutions = (
        f"{what} resolution, {unit}"
        for what, unit in zip(("torque", "position"), units, strict=True)
    )
    return table(
        "",
        ("axis", Column("drive", folds=True), *figures(*resolutions)),
        (
            (
                axis.name,
                axis.identity,
                f"{axis.torque_resolution:.3g}",
                f"{axis.position_resolution:.3g}",
            )
            for axis in session.axes
        ),
    )
