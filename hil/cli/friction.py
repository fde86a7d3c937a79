"""`hil friction`: laws of friction, fitted to a run, and their symmetry."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hil.cli.arguments import RunPath
from hil.cli.completion import runs
from hil.cli.outputs import refuse_unwritable, say_simulated, show
from hil.terminal.console import out, say, working

commands = typer.Typer()


@commands.command()
def friction(
    folder: RunPath,
    model: Annotated[
        Path | None,
        typer.Option(
            help="Identified run, whose model compensates gravity.",
            autocompletion=runs,
        ),
    ] = None,
    asymmetry: Annotated[
        float | None,
        typer.Option(min=0, help="Maximum asymmetry, as a fraction of the friction level."),
    ] = None,
) -> None:
    """Fit laws of friction to a run and test their symmetry.

    Writes friction.yaml into the folder of the run.
    """
    with working("reading the run") as now:
        from hil.estimation.friction.symmetry import BOUND
        from hil.results.friction import fit_friction
        from hil.results.friction_file import NAME, write_friction
        from hil.results.tables import friction as tables
        from hil.results.tables.terminal import show_remark
        from hil.runs.run import Run

        refuse_unwritable(folder / NAME)
        run = Run.open(folder)
        now("fitting models of friction")
        found = fit_friction(run, model, BOUND if asymmetry is None else asymmetry)
    path = write_friction(run, found)
    say_simulated(run)
    show(tables.models(found), tables.symmetry(found.symmetry), tables.drift(found.drifts))
    for left in found.left_out:
        show_remark(f"left out: {left}", out)
    say(f"friction in {path}")
