"""Sections about a run: findings, drive trains, sessions, and results kept in its folder.

A model (`model.yaml`) holds results of other commands: verdicts of validations, bodies. A load
(`load.yaml`) and a diagnosis (`diagnosis.yaml`) take as long as the report itself, and a load needs
a second run, so reports do not compute them again. A stale result is not shown; the report states
why and how to renew it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.commands import diagnose, payload
from hil.errors import FileError
from hil.results import consistency
from hil.results.load_file import LoadFile
from hil.results.tables.parameters import drive_train
from hil.show.outcome import Outcome, Section
from hil.show.rounding import significant, when
from hil.show.table import Column, Marked, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.commands.diagnose import DiagnosisFile
    from hil.report.reported_run import ReportedRun
    from hil.results.judgement import KeptJudgement


def current(
    kind: type[LoadFile | DiagnosisFile], run: ReportedRun, command: str
) -> tuple[Any, str]:
    """Read a kept result, or the reason for not showing it.

    Parameters
    ----------
    kind : type
        Kind of the result.
    command : str
        Command to renew the result.

    Returns
    -------
    kept : LoadFile, DiagnosisFile or None
    note : str
        Reason for not showing the result; empty if shown or missing.
    """
    try:
        kept = kind.read(run.source.path)
        stale = kept.stale(run.source, run.model.values) if kept else ""
        why = f"is stale and not shown: {stale}" if stale else ""
    except FileError as error:
        why = f"cannot be used: {error}"
    if why:
        return None, f"{kind.names[0]} {why}. Write it anew with: {command}"
    return kept, ""


def _section(heading: str, found: Outcome, intro: str = "") -> Section:
    return Section(heading, "kept.html", {"intro": intro, "found": found}, found.plots)


def validation(run: ReportedRun) -> Section | None:
    """Create the section of validations of the kept model."""
    kept = run.kept_model
    if kept is None or not kept.validations:
        return None
    return _section("Validation", Outcome((judgements(kept.validations),)))


def judgements(kept: Sequence[KeptJudgement]) -> Table:
    """Tabulate the judgements of a model by other recordings."""
    return table(
        "Judged by other recordings",
        ("run", "judgement", *figures("error, %"), Column("reason", folds=True)),
        (
            (
                each.run,
                each.word if each.word == "good" else Marked(each.word),
                "" if each.relative is None else significant(100 * each.relative, 2),
                each.clause,
            )
            for each in kept
        ),
        "By hil validate: judgement, error of the predicted torques, and the worst finding.",
    )


def bodies(run: ReportedRun) -> Section | None:
    """Create the section of the kept model's bodies, if the model is current."""
    kept = run.kept_model
    if kept is None or kept.consistent is None:
        return None
    return _section("Bodies", Outcome(consistency.tables(run.robot, kept.consistent)))


def load(run: ReportedRun) -> Section | None:
    """Create the section of the kept load, or of the reason for its absence."""
    command = f"hil payload WITHOUT {run.source.path}"
    found, note = current(LoadFile, run, command)
    if found is None:
        return _section("The load", Outcome(), f"{note}.") if note else None
    bare = found.without
    intro = (
        f"From two runs of the same robot, without ({bare.folder}, {when(bare.measured)}) and with"
        " the load (this run). Parameters, load and friction follow from both runs at once by least"
        " squares."
    )
    return _section("The load", payload.file_outcome(found, run.robot), intro)


def diagnosis(run: ReportedRun) -> Section | None:
    """Create the section of the kept diagnosis, or of the reason for its absence."""
    heading, command = "Parameters absent from the robot file", f"hil diagnose {run.source.path}"
    found, note = current(diagnose.DiagnosisFile, run, command)
    if found is None:
        return _section(heading, Outcome(), f"{note}.") if note else None
    intro = (
        "Every link parameter absent in the robot file is tested together with all stated ones; "
        "parameters that these measurements do not distinguish are tested as one."
    )
    return _section(heading, diagnose.file_outcome(found, run.robot), intro)


def advice(run: ReportedRun) -> Section | None:
    """Create the section of remedies and notes beyond the first sentence."""
    outcome = run.model.verdict
    items = (*(outcome.further if outcome else ()), *run.found.advice)
    if run.source.imported and not items:
        return None
    urgent = [item for item in items if item.word != "good"]
    by_remedy = (
        Part(
            tuple((e.subject, e.reason) for e in urgent if e.remedy == each),
            f"Remedy: {each}" if each else "",
        )
        for each in dict.fromkeys(item.remedy for item in urgent)
    )
    values = {
        "urgent": table("", ("where", Column("finding", folds=True)), by_remedy),
        "notes": [item for item in items if item.word == "good"],
    }
    return Section("Findings and remedies", "advice.html", values)


def drive_trains(run: ReportedRun) -> Section | None:
    """Create the section of drive trains; None without estimates."""
    axes = drive_train(run.estimate)
    if not axes:
        return None
    return Section("Drive trains", "drive_train.html", {"axes": axes})


def sessions(run: ReportedRun) -> Section:
    """Create the section of sessions with axes, and digests of robot file and plan."""
    units = {"torque": run.robot.torque_units, "position": run.robot.position_units}
    resolutions = (f"{what} resolution, {unit}" for what, unit in units.items())
    heads: tuple[str | Column, ...] = ("axis", Column("drive", folds=True), *figures(*resolutions))
    listed = []
    for each in run.source.journal.sessions:
        rows = [
            (
                axis.name,
                axis.identity,
                f"{axis.torque_resolution:.3g}",
                f"{axis.position_resolution:.3g}",
            )
            for axis in each.axes
        ]
        listed.append((each, table("", heads, rows)))
    values = {"sessions": listed, "robot": run.robot, "plan": run.source.plan}
    return Section("Sessions and drives", "sessions.html", values)
