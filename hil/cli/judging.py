"""Commands `hil validate`, `hil accept`, `hil history` and `hil fleet`.

The commands judge a model by held-out data, a run by limits in series production, a machine's
condition over many runs, and the machines of a fleet.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from checked_files.foreign_text import printable
from hil.cli.arguments import (
    RealTime,
    RobotsBus,
    RunPath,
    Scheduler,
    Without,
    Workers,
    executor,
    expand_records,
    files,
    robots,
    runs,
)
from hil.cli.measuring import OnBus
from hil.cli.measuring import measure as measure_plan
from hil.cli.outputs import (
    Status,
    file_to_write,
    folder_to_write,
    output_option,
    page_option,
    place_to_write,
    refuse_existing,
    refuse_no_folder,
    refuse_unwritable,
    show,
    show_causes,
    write_page,
)
from hil.cli.results import Accuracy, Method, Others, refuse_unknown
from hil.terminal.console import give, out, say, working

if TYPE_CHECKING:
    from hil.commands.fleet import Runs
    from hil.show.outcome import Outcome


commands = typer.Typer()


@commands.command()
@expand_records
def validate(
    folder: RunPath,
    model_path: Annotated[
        Path | None,
        Option(
            "--model",
            help="Model to validate: its file, or the folder of its run.",
            autocompletion=runs,
        ),
    ] = None,
    truth: Annotated[
        str | None,
        Option(
            help="Plant file or built-in plant with the true parameters, for comparison with the "
            "estimate of this run.",
            autocompletion=robots,
        ),
    ] = None,
    measure: Annotated[
        bool,
        Option("--measure", help="Measure another motion into the folder first; the robot moves."),
    ] = False,
    method: Method = None,
    others: Others = None,
    without: Without = None,
    accuracy: Accuracy = 10.0,
    *,
    where: RobotsBus,
    realtime: RealTime = False,
) -> None:
    """Validate a model on held-out data, or an estimate against a known truth.

    The run must differ from the one of the identification. With --truth the run is from a virtual
    plant, and its own estimate is compared. Exit status 3 where the model failed.
    """
    if truth is not None and model_path is None:
        if measure or realtime or where != RobotsBus():
            raise typer.BadParameter(
                "--measure and bus options cannot be used with --truth (no measurement takes place)"
            )
        with working("reading the run") as now:
            from hil.ground_truth.comparison import truth_comparison
            from hil.results.identification import method_for
            from hil.runs.pooling import open_runs

            refuse_unknown(method)
            run, *more = open_runs([folder, *(others or ())])
            run = run.exclude(without or ())
            now(f"comparing the estimate of {run.robot.name} with the truth")
            compared = truth_comparison(run, truth, method or method_for(run, more)[0], more)
        show(compared.summary())
        give(
            relative_errors={**compared.group_error, "torques": compared.mean_torque_error},
            within_intervals=int(compared.inside.sum()),
            parameters=len(compared.values),
        )
        return
    if model_path is None or truth is not None:
        raise typer.BadParameter("give either --model, or --truth for a virtual plant")
    if method or others or without:
        raise typer.BadParameter(
            "--method, --with and --without need --truth; a model is validated unchanged"
        )
    with working("reading the model"):
        from hil.commands import validate as command
        from hil.results.model import Model
        from hil.results.model_file import file_of
        from hil.runs.run import Run

        refuse_unwritable(folder / command.NAME)
        model_path = file_of(model_path)
        model = Model.load(model_path)
    if measure:
        from hil.model import robot
        from hil.planning.design.trajectories import design_validation

        robot.refuse_unknown(model.robot)
        with working("choosing a motion"):
            plan = design_validation(model.robot)
        how = OnBus(**vars(where), realtime=realtime)
        measure_plan(plan, model.robot, folder / "plan.yaml", folder, how)
    run = Run.open(folder)
    with working("predicting the torques of the recordings"):
        found = command.validate(model, model_path, run, accuracy / 100)
    word = found.verdicts[0].kind
    show(found)
    if found.tables and word != "good":
        show_causes(model_path, run)
    if found.tables:
        write_page(folder / command.PAGE, found)
    say(f"validation in {folder / command.NAME}")
    if word == "failed":
        raise typer.Exit(Status.REFUSED)


@commands.command()
def accept(
    folder: RunPath,
    output: Annotated[
        Path,
        output_option(
            place_to_write, "Folder for page and JUnit XML; with --draft, the file of limits."
        ),
    ],
    limits: Annotated[
        Path | None, Option("--limits", help="File of limits.", autocompletion=files)
    ] = None,
    draft: Annotated[
        bool, Option("--draft", help="Write limits from this run, a known good one.")
    ] = False,
    reference: Annotated[
        Path | None,
        Option(
            help="Reference for the diagnosis of a failed run; by default the run that the"
            " limits were drafted from, if found next to the limits or the judged run.",
            autocompletion=runs,
        ),
    ] = None,
    factor: Annotated[
        float,
        Option(min=1.0, max=1000.0, help="Width of drafted limits, in widths of 95 % intervals."),
    ] = 3.0,
    serial: Annotated[str, Option(help="Serial number of the robot.")] = "",
    operator: Annotated[str, Option(help="Name of the person who accepts the robot.")] = "",
) -> None:
    """Judge an identified run by limits; writes a page to sign and JUnit XML.

    Exit status 3 where the run failed.
    """
    if draft and limits is None:
        from hil.commands.accept import draft_limits, write_limits

        refuse_existing(output)
        refuse_no_folder(output)
        with working("reading the run"):
            drafted = draft_limits(folder, factor)
        write_limits(output, drafted)
        say(f"{len(drafted.quantities) + len(drafted.residual)} limits in {output}; adjust them to "
            "the permitted variation of the series")  # fmt: skip
        return
    if draft or limits is None:
        raise typer.BadParameter("give either --limits FILE or --draft", param_hint="--limits")
    stated = {"Serial number": printable(serial), "Operator": printable(operator)}
    from checked_files.yaml_file import load_yaml
    from hil.commands.accept import PAGE, Limits, outcome
    from hil.runs.run import Run

    bounds, run = load_yaml(limits, Limits), Run.open(folder)
    with working("judging the run by the limits"):
        found = outcome(run, bounds, output, stated)
    show(found)
    write_page(output / PAGE, found)
    if found.verdicts[0].kind == "failed":
        beside = (each.parent / bounds.drafted_from for each in (limits, folder.resolve()))
        drafted_from = next((each for each in beside if (each / "run.json").exists()), None)
        if before := reference or drafted_from:
            show_causes(before, run)
        raise typer.Exit(Status.REFUSED)


@commands.command()
def history(
    folders: Annotated[
        list[Path], Argument(metavar="RUN", help="Identified runs.", autocompletion=runs)
    ],
    reference: Annotated[
        Path | None,
        Option(
            help="Reference run for the comparison; the earliest by default.", autocompletion=runs
        ),
    ] = None,
    wander: Annotated[
        float,
        Option(
            min=0.0,
            max=99.0,
            help="Minimum allowance for changes of friction by temperature \\[%].",
        ),
    ] = 0.0,
    page: Annotated[Path | None, page_option("Page with plots to write")] = None,
    identify: Annotated[
        bool, Option("--identify", help="Identify runs that have no model yet.")
    ] = False,
    fail_on_change: Annotated[
        bool,
        Option(
            "--fail-on-change", help="Exit with status 4 if a quantity of the newest run changed."
        ),
    ] = False,
) -> None:
    """Show how parameters and friction of one machine change over many runs."""
    with working(f"reading {len(folders)} runs") as now:
        from hil.commands.history import monitoring_data, outcome, read_history
        from hil.results.model_file import file_of
        from hil.runs.run import Run

        if identify:
            from hil.estimation.identify import default_method
            from hil.results.findings import found_in

        for folder in (*folders, *([reference] if reference else [])) if identify else ():
            if folder.is_dir() and not (path := file_of(folder)).exists():
                now(f"identifying {folder}")
                run = Run.open(folder)
                found_in(run, default_method(run.motions)[0]).model.save(path)
                say(f"model in {path}")
        now(f"comparing {len(folders)} runs")
        found = read_history(folders, reference, wander / 100)
    shown, last = outcome(found), found.runs[-1]
    show(shown)
    newest = found.sentences(last)
    if newest and (Path(last.label) / "run.json").exists():
        show_causes(Path(found.reference), Run.open(last.label))
    give(history=monitoring_data(found))
    if page is not None:
        write_page(page, shown)
    if fail_on_change and newest:
        raise typer.Exit(Status.CHANGED)


fleet_commands = typer.Typer(no_args_is_help=True)
commands.add_typer(
    fleet_commands,
    name="fleet",
    help="Index the models of many machines, and find machines that deviate from the fleet.",
)

Index = Annotated[Path, Argument(metavar="INDEX", help="Index of a fleet.")]
Rate = Annotated[
    float,
    Option(min=0.001, max=100.0, help="Maximum number of false alarms per machine in ten years."),
]


@fleet_commands.command()
def index(
    folders: Annotated[
        list[str],
        Argument(
            metavar="FOLDER",
            help="Folders MACHINE/RUN of identified runs; object storage addresses are accepted.",
        ),
    ],
    output: Annotated[
        Path, output_option(folder_to_write, "Folder of the index to create or extend.")
    ] = Path("fleet.parquet"),
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Add the models of all runs in folders to an index; known models are not read again."""
    from hil.commands.fleet import index as index_models

    with executor(workers, scheduler) as execute, out.status("looking for models") as status:
        found = index_models(folders, output, execute, status.update)
    give(added=found.new)
    _finish(found, f"{found.new} runs added to {output}, {found.known} known already")


@fleet_commands.command()
def identify(
    folders: Annotated[
        list[Path], Argument(metavar="FOLDER", help="Folders with run folders at any depth.")
    ],
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Identify the runs in folders, in parallel; up-to-date models stay.

    The same command resumes an interrupted one.
    """
    from hil.commands.fleet import identify_runs

    with executor(workers, scheduler) as execute, out.status("looking for runs") as status:
        found = identify_runs(folders, execute, status.update)
    verdicts: dict[str, int] = dict(found.verdicts or {})
    give(identified=found.new, verdicts=verdicts)
    words = ", ".join(f"{n} {word}" for word, n in sorted(verdicts.items()) if word)
    sentence = f"{found.new} runs identified, {found.known} up to date"
    _finish(found, f"{sentence}: {words}" if words else sentence)


def _finish(found: Runs, sentence: str) -> None:
    """State which runs were left out and why; exit status 3 if there are any."""
    for reason in found.left_out:
        say(f"left out: {reason}", style="yellow")
    say(sentence)
    give(known=found.known, left_out=list(found.left_out))
    if found.left_out:
        raise typer.Exit(Status.REFUSED)


@fleet_commands.command()
def query(path: Index, rate: Rate = 0.5) -> None:
    """List machines that deviate from their own past or from the fleet."""
    show(_tested(path, rate))


@fleet_commands.command()
def page(
    path: Index,
    output: Annotated[
        Path,
        Option("-o", "--output", callback=file_to_write, help="Page to write; one HTML file."),
    ] = Path("fleet.html"),
    rate: Rate = 0.5,
) -> None:
    """Write a page of the deviating machines, with their quantities over time."""
    write_page(output, _tested(path, rate))


def _tested(path: Path, rate: float) -> Outcome:
    with working("testing all machines"):
        from hil.commands.fleet import ask
        from hil.results.fleet_index import read_fleets

        return ask(read_fleets(path), rate)
