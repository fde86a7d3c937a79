"""Commands for results of runs: identify, report, diagnose, friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Option

from hil.cli.arguments import Masses, RunPath, RunPaths, Without, body_bounds, methods, runs
from hil.cli.outputs import (
    Status,
    folder_to_write,
    refuse_unwritable,
    say_simulated,
    say_verdicts,
    show,
)
from hil.terminal.console import give, say, working

if TYPE_CHECKING:
    from hil.estimation.options import Options
    from hil.results.model import Model
    from hil.runs.run import Run

commands = typer.Typer()

Method = Annotated[
    str | None,
    Option(
        help="Method of estimation; an unknown name lists all.",
        show_default="by the kind of recordings",
        autocompletion=methods,
    ),
]
Others = Annotated[
    list[Path] | None,
    Option(
        "--with",
        metavar="RUN",
        help="Additional run to identify jointly; may be repeated.",
        autocompletion=runs,
    ),
]
Accuracy = Annotated[
    float,
    Option(
        min=0.1,
        max=100.0,
        help="Maximum residual for the verdict good, as a share of the axis's torque \\[%].",
    ),
]


@commands.command()
def identify(
    folders: RunPaths,
    method: Method = None,
    others: Others = None,
    without: Without = None,
    consistent: Annotated[
        bool,
        Option("--consistent", help="Also find the nearest physically consistent parameters."),
    ] = False,
    masses: Masses = None,
    prior: Annotated[
        str | None,
        Option(
            metavar="cad=SHARE",
            help="Relative uncertainty (1 sigma) of the inertials of --urdf, such as cad=0.3; a"
            " prior for parameters that the motion does not excite.",
        ),
    ] = None,
    urdf: Annotated[
        Path | None, Option(help="URDF of the robot with inertials, such as CAD exports.")
    ] = None,
    accuracy: Accuracy = 10.0,
    refine: Annotated[
        Literal["simulation"] | None,
        Option(
            metavar="simulation",
            help="Fit simulated to recorded positions, from the regression's model; kept if better"
            " on held-out recordings.",
        ),
    ] = None,
) -> None:
    """Identify dynamics and friction from measured or imported runs.

    Writes model.yaml into the first folder. Exit status 3 where the identification failed.
    """
    begun = perf_counter()
    with working("reading the run") as now:
        from hil.estimation.friction.points import judge_local_values
        from hil.results import identification, model_file
        from hil.results.advice import budget_table
        from hil.results.findings import identify_and_keep
        from hil.results.tables import excluded
        from hil.results.tables.friction import symmetry
        from hil.runs.pooling import Pooled, open_runs, pooled
        from hil.show.rounding import count

        refuse_unknown(method)
        bounds = body_bounds(masses)
        path = folders[0] / model_file.NAME
        refuse_unwritable(path)
        run, *more = open_runs([*folders, *(others or ())])
        run = run.exclude(without or ())
        options = replace(options_of(prior, urdf, run), accuracy=accuracy / 100)
        bounds.refuse_other_links(run.robot)
        if method is None:
            method, reason = identification.method_for(run, more)
            if run.imported or any(each.imported for each in more):
                say(f"{method} method: {reason}")
        recorded = count(sum(map(len, (run, *more))), "measurement")
        now(f"estimating {run.robot.name} from {recorded}")
        found = identify_and_keep(run, method, more, options=options).model
        if refine:
            from hil.simulation.refine import refine as refined

            now("fitting simulated to recorded positions")
            every = Pooled([run, *more])
            found = identification.rejudged(refined(found, every), every, options)
        if consistent or masses:
            from hil.results.consistency import find_consistent_robot

            now("finding the nearest physically consistent robot")
            found = find_consistent_robot(found, pooled([run, *more]), bounds)
        found.save(path)
    say_verdicts(found.verdict.verdicts if found.verdict else ())
    say_simulated(run, *more)
    show(found.summary(), symmetry(judge_local_values(found.local)))
    if found.excluded is not None:
        tested = excluded.excluded(found.excluded, found.robot.n_joints)
        show(tested, *excluded.sentences(found.excluded))
    causes = (f"{term.cause}: {term.found}" for term in found.error_budget)
    show(budget_table(found.error_budget), *causes)
    show_bodies(found)
    for each in (run, *more):
        _show_shortfall(each)
    give(model=str(path), refinement=found.refinement and found.refinement.model_dump(mode="json"))
    say(f"model in {path} ({perf_counter() - begun:.1f} s)")
    if found.failed:
        raise typer.Exit(Status.REFUSED)


def options_of(prior: str | None, urdf: Path | None, run: Run) -> Options:
    """Create estimation options with a prior such as ``cad=0.3`` from a URDF's inertials."""
    from hil.estimation.options import DEFAULTS, Options

    if (prior is None) != (urdf is None):
        raise typer.BadParameter(
            "--prior takes inertials from a URDF: give both --prior and --urdf, or neither"
        )
    if prior is None or urdf is None:
        return DEFAULTS
    from checked_files.yaml_file import FileError
    from hil.estimation.prior import Prior
    from hil.export.urdf_file import bodies_of, given_urdf, inertial_faults

    kind, _, share = prior.partition("=")
    try:
        relative = float(share)
    except ValueError:
        relative = 0.0
    if kind != "cad" or not 0.0 < relative <= 1.0:
        raise typer.BadParameter(
            f"--prior {prior}: must be cad=SHARE, above 0 and at most 1: cad=0.3"
        )
    given = given_urdf(urdf, run.robot)
    bodies = bodies_of(given, run.robot)
    if bodies is None:
        raise FileError("\n".join(inertial_faults(given, run.robot)))
    return Options(prior=Prior(bodies, relative, f"the inertials of {urdf.name}"))


@commands.command()
def report(
    folder: RunPath,
    figures: Annotated[
        Path | None,
        Option(callback=folder_to_write, help="Folder to write the plots into as SVG files, too."),
    ] = None,
    without: Without = None,
) -> None:
    """Write the report of a run; one HTML file."""
    begun = perf_counter()
    with working("reading the run") as now:
        from checked_files.yaml_file import FileError
        from hil.estimation.identify import METHODS, RIVALS
        from hil.report import page as module
        from hil.results.model_file import NAME, read_model_file
        from hil.runs.run import Run

        refuse_unwritable(folder / module.NAME)
        run = Run.open(folder).exclude(without or ())
        now(f"identifying {run.robot.name} and drawing the report")
        path = module.report(run, figures)
    # the reason for ignoring an existing model: damaged, edited, or of a rival method
    kept, why = run.path / NAME, None
    try:
        used = read_model_file(kept).provenance.method if kept.exists() else None
        if used is not None and used not in METHODS:
            why = f"{kept}: {used} method; {RIVALS}"
    except FileError as error:
        why = str(error)
    if why is not None:
        say(f"model not used, the report shows a new estimate: {why}", style="yellow")
    _show_shortfall(run)
    say_simulated(run)
    say(f"report in {path} ({perf_counter() - begun:.1f} s)")


@commands.command()
def diagnose(folder: RunPath, without: Without = None) -> None:
    """Test a robot file for missing effects and wrong values.

    Writes diagnosis.yaml into the folder of the run.
    """
    with working("reading the run") as now:
        from hil.commands import diagnose as command
        from hil.runs.run import Run

        refuse_unwritable(folder / command.NAME)
        run = Run.open(folder).exclude(without or ())
        now(f"testing for effects missing in the robot file of {run.robot.name}")
        diagnosis = command.diagnose(run)
        now("drawing")
        found = command.outcome(run, diagnosis)
    show(found)
    say(f"plots in {folder / command.PLOTS}")
    say(f"diagnosis in {folder / command.NAME}; hil report {folder} shows it")


@commands.command()
def friction(
    folder: RunPath,
    model: Annotated[
        Path | None,
        Option(help="Identified run, whose model compensates gravity.", autocompletion=runs),
    ] = None,
    asymmetry: Annotated[
        float | None,
        Option(min=0, help="Maximum asymmetry, as a fraction of the friction level."),
    ] = None,
) -> None:
    """Fit friction laws to a run and test the symmetry of friction.

    Writes friction.yaml into the folder of the run.
    """
    with working("reading the run") as now:
        from hil.commands.friction import NAME, fit_friction, outcome, write_friction
        from hil.estimation.friction.points import BOUND
        from hil.runs.run import Run

        refuse_unwritable(folder / NAME)
        run = Run.open(folder)
        now("fitting friction models")
        found = fit_friction(run, model, BOUND if asymmetry is None else asymmetry)
    path = write_friction(run, found)
    show(outcome(run, found))
    say(f"friction in {path}")


def refuse_unknown(method: str | None) -> None:
    """Refuse an unknown method.

    Raises
    ------
    typer.BadParameter
        An unknown method; the message lists the known ones.
    """
    from hil.estimation.identify import METHODS, RIVALS

    if method is not None and method not in METHODS:
        from checked_files.near import did_you_mean

        known = "; ".join(METHODS)
        near = did_you_mean(method, METHODS)
        raise typer.BadParameter(
            f"{method} must be one of: {known}{near}; {RIVALS}", param_hint="--method"
        )


def show_bodies(model: Model) -> None:
    """Show the bodies of a model, if computed."""
    if model.consistent is None:
        return
    from hil.results.consistency import tables

    show(*tables(model.robot, model.consistent))


def _show_shortfall(run: Run) -> None:
    if run.shortfall:
        say(run.shortfall, style="yellow")
