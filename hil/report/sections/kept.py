"""Results kept in a run's folder by other commands, checked against the present run.

A model (`model.yaml`) holds results of other commands: verdicts of validations, bodies. A load
(`load.yaml`) and a diagnosis (`diagnosis.yaml`) take as long as the report itself, and a load needs
a second run, so reports do not compute them again. A stale result is not shown; the report states
why and how to renew it.

Sections about the run: findings, drive trains, sessions.

Causes of error found, excluded and invisible in the recordings.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, TypeVar

from hil.commands import diagnose, payload
from hil.errors import FileError
from hil.results import consistency, load_file
from hil.results.tables import excluded as tables
from hil.results.tables.parameters import drive_train
from hil.show.charts.chart import INK, Chart, Panel, Points, chart, ordered_colours
from hil.show.outcome import Outcome
from hil.show.rounding import significant, when
from hil.show.section import Plot, Section
from hil.show.table import Column, Marked, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.commands.diagnose import DiagnosisFile
    from hil.estimation.excluded.result import Excluded, Limit
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.results.judgement import KeptJudgement, Reservation
    from hil.results.load_file import LoadFile
    from hil.runs.journal import Session
    from hil.runs.run import Run
    from hil.show.charts.chart import Item

LEAST = 1e-3
"""Lower end of the axis [%]: a tenth of the smallest detectable torque of measured campaigns."""


def excluded(run: ReportedRun) -> Section | None:
    """Create the section of excluded causes: findings, detectable sizes and torques."""
    proof, n_joints = run.model.excluded, run.robot.n_joints
    if proof is None:
        return None
    plot = Plot(
        "excluded",
        partial(dots, proof, n_joints),
        "Largest undetected torque by each cause, for each axis.",
        "Largest undetected torque by each cause, for each axis, in % of the axis's recorded "
        "torque. Rings: causes invisible in these recordings, at their usual size.",
    )
    values = {
        "excluded": tables.excluded(proof, n_joints),
        "sentences": tuple(tables.sentences(proof)),
    }
    return Section("What is excluded", "excluded.html", values, (plot,))


def dots(proof: Excluded, n_joints: int) -> Chart:
    """Draw the largest undetected torques by cause and axis."""
    drawn = [
        each
        for each in proof.limits
        if 100.0 * each.unnoticed > LEAST and (each.cause, each.axis) not in proof.places
    ]
    names = list(dict.fromkeys(map(_name, drawn)))
    most = max([100.0, *(100.0 * each.unnoticed for each in drawn)])
    return chart(
        Panel(
            [
                _dot(each, len(names) - names.index(_name(each)), n_joints)
                for each in sorted(drawn, key=lambda each: each.axis)
            ],
            x_label="largest undetected torque [%]",
            x_range=(LEAST, most),
            y_range=(0.4, len(names) + 0.6),
            rows={float(len(names) - k): name for k, name in enumerate(names)},
            decades=True,
            width=760.0,
            left=150.0,
            height=max(30.0 * len(names), 120.0),
        )
    )


def _name(limit: Limit) -> str:
    return f"{limit.cause} {limit.part}".strip()


def _dot(limit: Limit, row: int, n_joints: int) -> Item:
    """Draw a dot in a row: axis 1 at the top, no axis in the middle."""
    at = row + (0.35 - 0.7 * (limit.axis - 0.5) / n_joints if limit.axis else 0.0)
    torque = 100.0 * limit.unnoticed
    if limit.size is None:
        return Points([torque], [at], "ring", INK, "invisible", size=2.4)
    colour = ordered_colours(n_joints)[limit.axis - 1] if limit.axis else INK
    label = f"axis {limit.axis}" if limit.axis else "no axis in particular"
    return Points([torque], [at], "o", colour, label, size=3.0)


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


K = TypeVar("K", "LoadFile", "DiagnosisFile")


def current(
    read: Callable[[Run], K | None], run: ReportedRun, name: str, command: str
) -> tuple[K | None, str]:
    """Read a kept result, or the reason for not showing it.

    Parameters
    ----------
    read : callable
        Function that returns the kept result of a folder, or None.
    name : str
        Name of the result's file.
    command : str
        Command to renew the result.

    Returns
    -------
    kept : K or None
    note : str
        Reason for not showing the result; empty if shown or missing.
    """
    try:
        kept = read(run.source)
        stale = kept.stale(run.source, run.model.values) if kept else ""
    except FileError as error:
        return None, f"{name} cannot be used: {error}. Make it anew with: {command}"
    if stale:
        return None, f"{name} is stale and not shown: {stale}. Make it anew with: {command}"
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
    found, note = current(load_file.read_load, run, load_file.NAME, command)
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
    found, note = current(diagnose.load_diagnosis, run, diagnose.NAME, command)
    if found is None:
        return _section(heading, Outcome(), f"{note}.") if note else None
    intro = (
        "Every link parameter absent in the robot file is tested together with all stated ones; "
        "parameters that these measurements do not distinguish are tested as one."
    )
    return _section(heading, diagnose.file_outcome(found, run.robot), intro)
