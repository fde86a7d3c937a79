"""`hil accept`: a run against limits, for who commissions robots in series."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.arguments import RunPath
from hil.cli.outputs import (
    REFUSED,
    output_option,
    place_to_write,
    refuse_existing,
    refuse_no_folder,
    say_judgement,
    say_simulated,
)
from hil.terminal.console import out, printable, say, working

commands = typer.Typer()
PAGE, JUNIT = "acceptance.html", "acceptance.xml"


@commands.command()
def accept(
    folder: RunPath,
    output: Annotated[
        Path, output_option(place_to_write, "Folder of page and JUnit XML; file of a draft.")
    ],
    limits: Annotated[
        Path | None, typer.Option("--limits", help="File of limits that the run is judged by.")
    ] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Write limits from this run, which is a good one.")
    ] = False,
    factor: Annotated[
        float, typer.Option(min=1.0, max=1000.0, help="Factor by which a draft widens intervals.")
    ] = 3.0,
    serial: Annotated[str, typer.Option(help="Serial number of the robot.")] = "",
    operator: Annotated[str, typer.Option(help="Name of whoever accepts the robot.")] = "",
) -> None:
    """Judge an identified run by limits; writes a page and JUnit XML, exit status 3 if failed."""
    if draft == (limits is not None):
        raise typer.BadParameter("give either --limits FILE or --draft", param_hint="--limits")
    if draft:
        _draft(folder, output, factor)
        return
    assert limits is not None  # noqa: S101 - see above
    stated = {"Serial number": printable(serial), "Operator": printable(operator)}
    if not _accepted(folder, output, limits, stated):
        raise typer.Exit(REFUSED)


def _draft(folder: Path, output: Path, factor: float) -> None:
    from hil.results.acceptance import draft, write_limits
    from hil.results.model import Model
    from hil.runs.run import Run

    refuse_existing(output)
    refuse_no_folder(output)
    with working("reading the run"):
        found = draft(Run.open(folder), Model.load(folder), factor)
    write_limits(output, found)
    say(f"{len(found.quantities) + len(found.residual)} limits in {output}; set them to what the"
        " series may vary by")  # fmt: skip


def _accepted(folder: Path, output: Path, limits: Path, stated: dict[str, str]) -> bool:
    from checked_files.yaml_file import load_yaml
    from hil.report.further_pages import write_acceptance_page
    from hil.results.acceptance import Limits, judge, table, write_junit
    from hil.results.model import Model
    from hil.results.tables.terminal import show
    from hil.runs.atomic_file import file_errors
    from hil.runs.run import Run

    bounds = load_yaml(limits, Limits)
    with file_errors(output, "made"):
        output.mkdir(parents=True, exist_ok=True)
    with working("judging the run by the limits"):
        run, model = Run.open(folder), Model.load(folder)
        found = judge(run, model, bounds)
        write_acceptance_page(output / PAGE, run, found, stated)
    write_junit(output / JUNIT, run.robot.name, model.provenance.measured, found)
    say_simulated(run)
    show(table(found), out)
    say_judgement(found, f"page in {output / PAGE}")
    return found.word != "failed"
