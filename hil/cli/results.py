"""What runs give: a model, a report, a load, a diagnosis; and how true the model is."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import typer

from hil.cli.arguments import Masses, RunPath, Without, body_bounds
from hil.cli.outputs import REFUSED, folder_to_write, refuse_unwritable, say_simulated
from hil.terminal.console import out, say, working

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.runs.run import Run

commands = typer.Typer()
STYLES = {"good": "green", "doubtful": "yellow", "failed": "bold red"}


Method = Annotated[
    str | None,
    typer.Option(
        help="Name of the method of estimation; an unknown one lists all.",
        show_default="the one for what was recorded",
    ),
]
Others = Annotated[
    list[Path] | None,
    typer.Option(
        "--with", help="Further run that is identified together with it; may be repeated."
    ),
]


@commands.command()
def identify(
    folder: RunPath,
    method: Method = None,
    others: Others = None,
    without: Without = None,
    consistent: Annotated[
        bool,
        typer.Option(
            "--consistent", help="Find the nearest robot that consists of bodies as well."
        ),
    ] = False,
    masses: Masses = None,
) -> None:
    """Estimate base parameters from a run; exit status 3 where that failed."""
    begun = perf_counter()
    with working("reading the run") as now:
        from hil.estimation.friction.symmetry import of_local_values
        from hil.results import identification, kept_findings, model_file
        from hil.results.tables.error_budget import error_budget
        from hil.results.tables.friction import symmetry
        from hil.results.tables.terminal import show, show_sentence
        from hil.runs.pooling import open_runs, pooled

        _refuse_unknown(method)
        bounds = body_bounds(masses)
        path = folder / model_file.NAME
        refuse_unwritable(path)
        run, *more = open_runs([folder, *(others or ())])
        run = run.without(without or ())
        bounds.refuse_other_links(run.robot)
        if method is None:
            method, reason = identification.method_for(run, more)
            if run.imported:
                say(f"{method} method: {reason}")
        now(f"estimating {run.robot.name} from {sum(map(len, (run, *more)))} measurements")
        identified = identification.identified(run, method, more)
        found = identified.model
        if not (more or run.imported):
            kept_findings.keep_identified(run, identified)
        if consistent or masses:
            from hil.results.consistency import with_consistent_robot

            now("finding the nearest robot that consists of bodies")
            found = with_consistent_robot(found, pooled([run, *more]), bounds)
        found.save(path)
    if found.outcome is not None:
        say(str(found.outcome), style=STYLES[found.outcome.word])
    say_simulated(run, *more)
    out.print(found.summary())
    show(symmetry(of_local_values(found.local)), out)
    show(error_budget(found.error_budget), out)
    for term in found.error_budget:
        show_sentence(f"{term.cause}: {term.found}", out)
    show_bodies(found)
    for each in (run, *more):
        _show_shortfall(each)
    took = f"{perf_counter() - begun:.1f} s"
    say(f"model in {path} ({took})")
    if found.failed:
        raise typer.Exit(REFUSED)


@commands.command()
def report(
    folder: RunPath,
    figures: Annotated[
        Path | None,
        typer.Option(
            callback=folder_to_write, help="Folder that the plots are written to as SVG files too."
        ),
    ] = None,
    without: Without = None,
) -> None:
    """Write a run's report, one HTML file."""
    begun = perf_counter()
    with working("reading the run") as now:
        from hil.report import page as module
        from hil.runs.run import Run

        refuse_unwritable(folder / module.NAME)
        run = Run.open(folder).without(without or ())
        now(f"identifying {run.robot.name} and drawing the report")
        path = module.report(run, figures)
    _show_unusable_model(run)
    _show_shortfall(run)
    say_simulated(run)
    say(f"report in {path} ({perf_counter() - begun:.1f} s)")


@commands.command()
def compare(
    folder: RunPath,
    truth: Annotated[
        str,
        typer.Option(help="Plant file of the virtual plant, or name of a plant that comes along."),
    ],
    method: Method = None,
    others: Others = None,
    without: Without = None,
) -> None:
    """Set an estimate against the truth of the virtual plant."""
    with working("reading the run") as now:
        from hil.ground_truth import comparison as module
        from hil.results.identification import method_for
        from hil.runs.pooling import open_runs

        _refuse_unknown(method)
        run, *more = open_runs([folder, *(others or ())])
        run = run.without(without or ())
        now(f"estimating {run.robot.name} anew, beside the truth")
        module.compare(run, truth, out, method or method_for(run, more)[0], more)


@commands.command()
def diagnose(folder: RunPath, without: Without = None) -> None:
    """Test what the robot file leaves out and what it states; writes diagnosis.yaml."""
    with working("reading the run") as now:
        from hil.report.sections.kept import write_diagnosis_plots
        from hil.results import diagnosis, diagnosis_file
        from hil.results.tables.diagnosis import candidates, sentences
        from hil.results.tables.drive_train import drive_train
        from hil.results.tables.terminal import show, show_sentence
        from hil.runs.run import Run

        refuse_unwritable(folder / diagnosis_file.NAME)
        run = Run.open(folder).without(without or ())
        now(f"testing what the robot file of {run.robot.name} leaves out")
        found = diagnosis.diagnose(run)
        kept = diagnosis_file.write_diagnosis(run, found)
        now("drawing")
        plots = write_diagnosis_plots(folder, found)
    say_simulated(run)
    show(candidates(kept), out)
    for sentence in sentences(kept):
        show_sentence(sentence, out)
    show(drive_train(found.estimate, run.robot), out)
    say(f"plots in {plots}")
    say(f"diagnosis in {folder / diagnosis_file.NAME}; hil report {folder} shows it")


def _refuse_unknown(method: str | None) -> None:
    from hil.estimation.identify import METHODS

    if method is not None and method not in METHODS:
        from checked_files.near import did_you_mean

        known = "; ".join(METHODS)
        near = did_you_mean(method, METHODS)
        raise typer.BadParameter(f"{method} must be one of: {known}{near}", param_hint="--method")


def show_bodies(model: Model) -> None:
    """Show the bodies of a model, if they were asked for."""
    from hil.results.tables.consistent import bodies, changed_parameters, torque_costs
    from hil.results.tables.terminal import show

    if model.consistent is not None:
        for table in (bodies, changed_parameters, torque_costs):
            show(table(model.robot, model.consistent), out)


def _show_shortfall(run: Run) -> None:
    if run.shortfall:
        say(run.shortfall, style="yellow")


def _show_unusable_model(run: Run) -> None:
    """State that the kept model was cut off or edited: the report is of a new estimate."""
    from checked_files.yaml_file import FileError
    from hil.results.model_file import NAME, read_model_file

    path = run.path / NAME
    try:
        if path.exists():
            read_model_file(path)
    except FileError as error:
        say(f"not used, the report is of a new estimate: {error}", style="yellow")
