"""Command-line program of the study, on this machine or on a Dask cluster.

python -m benchmarks.drift_study -o FOLDER [--help]
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from checked_files.near import did_you_mean
from hil import cli
from hil.cli.arguments import PLANT, RobotsDrives
from hil.cli.outputs import folder_to_write
from hil.terminal.console import out, working
from hil.terminal.keys import interruptible

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

CHANGING = ("robot", "seeds", "first_seed", "scenario", "kind", "share", "minutes")
"""Options with an influence on the figures."""

app = typer.Typer(
    pretty_exceptions_enable=False, context_settings={"help_option_names": ["-h", "--help"]}
)


@app.command()
def drift(
    context: typer.Context,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", callback=folder_to_write, help="Folder of the study."),
    ],
    robot: Annotated[
        str, typer.Option(help="Name of a robot that comes along, or path of a robot file.")
    ] = PLANT,
    plant: Annotated[
        str | None,
        typer.Option(help="Plant file, or name of a plant; by default the robot's name."),
    ] = None,
    drives_file: RobotsDrives = None,
    seeds: Annotated[int, typer.Option(min=2, help="Number of plants in each scenario.")] = 20,
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first plant; the others count on from it.")
    ] = 101,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            help="Scenario off, on, strong, asymmetric or load; all by default, may be repeated."
        ),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            help="Campaign two-step, mixed, trajectory, compensated or warmed; all but the last by"
            " default, may be repeated."
        ),
    ] = None,
    share: Annotated[
        float | None,
        typer.Option(
            min=0.05,
            max=4,
            help="Number of measurements as a share of the designed plan's; 1 by default.",
        ),
    ] = None,
    minutes: Annotated[
        float | None,
        typer.Option(
            min=1,
            max=600,
            help="Duration of every campaign in place of the designed plan's \\[min].",
        ),
    ] = None,
    results: Annotated[
        bool, typer.Option("--results", help="Keep the figures for documents, as drift.json.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Number of campaigns at once; by default one a processor."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, such as tcp://host:8786.")
    ] = None,
) -> None:
    """Compare the two-step method with conventional ones, with or without drift."""
    from checked_files.yaml_file import FileError
    from hil import execution

    from . import drift as campaigns
    from . import summary, view
    from .campaigns import KINDS
    from .scenarios import SCENARIOS

    if share is not None and minutes is not None:
        raise typer.BadParameter(
            "--share and --minutes both set the duration; give one of them", param_hint="--minutes"
        )
    scenarios = _known(scenario, tuple(SCENARIOS), "--scenario") or tuple(SCENARIOS)
    kinds = _known(kind, KINDS, "--kind") or KINDS[:-1]
    numbers = range(first_seed, first_seed + seeds)
    workers = workers or os.cpu_count() or 1
    failed = 0
    left = f"stopped; what is done stays in {output}, the same command continues"
    with interruptible(lambda: left):
        try:
            with working("planning the campaigns"):
                cells = campaigns.prepare(
                    output,
                    robot,
                    plant or robot,
                    numbers,
                    scenarios,
                    kinds,
                    1.0 if share is None else share,
                    drives_file,
                    minutes,
                )
        except ValueError as error:
            raise FileError(f"{output}: {error}") from error
        where = execution.cluster(scheduler) if scheduler else execution.local(workers)
        with where as execute, view.shown(out) as show:
            for done in campaigns.measure_cells(cells, execute):
                show(done)
                failed += bool(done.error)
        with working("summing up"):
            rows = summary.summarise(campaigns.judged(cells))
            if rows:
                summary.write(output, rows)
                if results:
                    summary.keep_figures(rows, numbers, _command(context.params))
        if rows:
            view.render(rows, out)
            out.print(f"table and picture in {output}", highlight=False, soft_wrap=True)
    if failed:
        raise FileError(f"{output}: {failed} campaigns failed, see above; the same command retries")


def _command(given: Mapping[str, Any]) -> str:
    """Return the command that reproduces the figures."""
    words = ["python -m benchmarks.drift_study --results -o FOLDER"]
    for name in CHANGING:
        values = given[name] if isinstance(given[name], list | tuple) else [given[name]]
        words += [f"--{name.replace('_', '-')} {each}" for each in values if each is not None]
    return " ".join(words)


def _known(given: list[str] | None, known: tuple[str, ...], option: str) -> tuple[str, ...]:
    for name in given or ():
        if name not in known:
            near = did_you_mean(name, known)
            raise typer.BadParameter(
                f"{name} must be one of {', '.join(known)}{near}", param_hint=option
            )
    return tuple(name for name in known if name in (given or ()))


def main(arguments: Sequence[str] | None = None) -> None:
    """Entry point; exit status 1 after a message, 2 for wrong usage."""
    # matrices are small here: several threads would only wait for each other
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    cli.main(arguments, app, "python -m benchmarks.drift_study")


if __name__ == "__main__":
    main()
