"""Results that other commands keep in a run's folder, held against the run as it is now.

A model (`model.yaml`) holds what commands add to it: verdicts of validations, bodies. A load
(`payload.yaml`) and a diagnosis (`diagnosis.yaml`) take as long as the report itself, and a load
needs a second run, so reports do not compute them again. One that no longer belongs to the run is
not shown, and the report states why and how to make it anew.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hil.commands import payload
from hil.errors import FileError
from hil.planning.measurement import ELEMENT_KINDS
from hil.report.sections.elements import residuals_over_angles
from hil.results import consistency
from hil.results import diagnosis as kept_diagnosis
from hil.results.diagnosis import load_diagnosis
from hil.runs.atomic_file import own_folder, write_file
from hil.show.charts.chart import MODEL, Chart, Line, Panel, Points, chart
from hil.show.charts.svg import file
from hil.show.outcome import Outcome
from hil.show.rounding import signed, significant, when
from hil.show.section import Plot, Section
from hil.show.table import Column, Marked, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from hil.commands.payload import LoadFile
    from hil.estimation.gravity_phase import Phase
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun
    from hil.results.diagnosis import Diagnosis, DiagnosisFile
    from hil.results.judgement import KeptJudgement
    from hil.runs.run import Run


K = TypeVar("K", "LoadFile", "DiagnosisFile")


def current(
    read: Callable[[Run], K | None], run: ReportedRun, name: str, command: str
) -> tuple[K | None, str]:
    """Read a result of the run, or why it is not shown.

    Parameters
    ----------
    read : callable
        Returns what is kept in a folder, or None.
    name : str
        Of its file.
    command : str
        Which makes it anew.

    Returns
    -------
    kept : K or None
    note : str
        Empty where there is nothing, or nothing wrong with it.
    """
    try:
        kept = read(run.source)
        stale = kept.stale(run.source, run.model.values) if kept else ""
    except FileError as error:
        return None, f"{name} cannot be used: {error}. Make it anew with: {command}"
    if stale:
        return None, f"{name} is stale and not shown: {stale}. Make it anew with: {command}"
    return kept, ""


def validation(run: ReportedRun) -> Section | None:
    """Judgements of the kept model on other recordings."""
    kept = run.kept_model
    if kept is None or not kept.validations:
        return None
    return Section("Validation", "validation.html", {"judgements": judgements(kept.validations)})


def judgements(kept: Sequence[KeptJudgement]) -> Table:
    """What a model was worth on other recordings."""
    return table(
        "Judged by other recordings",
        ("run", "judgement", *figures("off by, %"), Column("reason", folds=True)),
        (
            (
                each.run,
                each.word if each.word == "good" else Marked(each.word),
                "" if each.relative is None else significant(100 * each.relative, 2),
                each.clause,
            )
            for each in kept
        ),
        "By hil validate: judgement, error of the predicted torques, and the worst of what was"
        " found.",
    )


def bodies(run: ReportedRun) -> Section | None:
    """Bodies that the kept model has, as long as it is the one of this report."""
    kept = run.kept_model
    if kept is None or kept.consistent is None:
        return None
    found = kept.consistent
    return Section(
        "Bodies",
        "bodies.html",
        {
            "bodies": consistency.bodies(run.robot, found),
            "changed": consistency.changed_parameters(run.robot, found),
            "costs": consistency.torque_costs(run.robot, found),
        },
    )


def _noted(note: str) -> dict[str, object]:
    """What a section shows in place of a result that is not shown."""
    return {"intro": f"{note}.", "found": Outcome()}


def load(run: ReportedRun) -> Section | None:
    """What is kept of a load, or why it is not shown."""
    command = f"hil payload WITHOUT {run.source.path}"
    found, note = current(payload.read_load, run, payload.NAME, command)
    if found is None:
        return Section("The load", "kept.html", _noted(note)) if note else None
    shown, bare = payload.of_file(found, run.robot), found.without
    intro = (
        f"From two runs of the same robot, without ({bare.folder}, {when(bare.measured)}) and with"
        " the load (this run). Parameters, load and friction follow from both runs at once by least"
        " squares."
    )
    return Section("The load", "kept.html", {"intro": intro, "found": shown}, shown.plots)


PHASE = (
    "Where what was found shifts a gravity torque most (the paper's Fig. 7): sinusoids at the"
    " measured configuration where the stated one is largest. Measurements at other configurations"
    " are brought to this one by the extended model, and what is the same in all of them is taken"
    " off."
)


def diagnosis(run: ReportedRun) -> Section | None:
    """What is kept of a diagnosis, or why it is not shown."""
    found, note = current(
        load_diagnosis, run, kept_diagnosis.NAME, f"hil diagnose {run.source.path}"
    )
    if found is None and not note:
        return None
    values = {"found": found, "note": note, "tables": kept_diagnosis}
    plots = _phase_plot(found, run.robot) if found else ()
    return Section("Parameters absent from the robot file", "diagnosis.html", values, plots)


def _phase_plot(found: DiagnosisFile, robot: Robot) -> tuple[Plot, ...]:
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


def shifted_sinusoid(phase: Phase, found: str, robot: Robot) -> Chart:
    """The paper's Fig. 7: a gravity torque by the robot file and by what was `found`."""
    angle = np.linspace(-np.pi, np.pi, 181)
    shown = np.degrees(angle)
    name = found if len(found) < 40 else "what was found"  # letters that a legend has room for
    error = 2.0 * np.nan_to_num(phase.standard_error)
    return chart(
        Panel(
            (
                Line(shown, phase.stated.at(angle), MODEL, "robot file", "5 3"),
                Line(shown, phase.extended.at(angle), MODEL, f"with {name}"),
                Points(np.degrees(phase.angle), phase.torque, error=error, label="measured"),
            ),
            title=f"phase offset {signed(f'{np.degrees(phase.shift):.1f}')}°",
            x_label=f"$q_{{{phase.over + 1}}}$ [deg]",
            y_label=f"$g_{{{phase.axis + 1}}}$ [{robot.torque_unit(phase.axis)}]",
            ticks={float(each): signed(f"{each}") for each in range(-180, 181, 60)},
            width=700.0,
            height=220.0,
        )
    )


def write_diagnosis_plots(run_folder: Path, found: Diagnosis) -> Path:
    """Draw residuals over angles and, where there is one, Fig. 7; return their folder."""
    place = run_folder / "diagnosis"
    own_folder(place)
    for name, drawn in _charts(found).items():
        write_file(place / f"{name}.svg", file(drawn))
    return place


def _charts(found: Diagnosis) -> dict[str, Chart]:
    local = found.estimate.local
    charts = {
        name: residuals_over_angles([v for v in local if v.kind == name], found.robot, kind)
        for name, kind in ELEMENT_KINDS.items()
        if not kind.pair
    }
    if found.phase is not None:
        labels = ", ".join(c.label for c in found.errors.found)
        charts["phase"] = shifted_sinusoid(found.phase, labels, found.robot)
    return charts
