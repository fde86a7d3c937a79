"""What two runs tell of a load, and what one run tells against its robot file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

commands = typer.Typer()
out = Console()

RunPath = Annotated[Path, typer.Argument(help="Folder of a run.")]


@commands.command()
def payload(
    without: Annotated[Path, typer.Argument(help="Folder of the run without the load.")],
    loaded: Annotated[Path, typer.Argument(help="Folder of the run with it.")],
    mass: Annotated[
        float | None,
        typer.Option(min=1e-3, help="Of the load, if known: corrects the drives [kg]."),
    ] = None,
) -> None:
    """Find a load's mass, centre and inertia from two runs, without and with it."""
    from hil.results import load  # noqa: PLC0415 - slow to import, used here only
    from hil.terminal import load_view  # noqa: PLC0415 - slow to import, used here only

    load_view.render(load.find_load(without, loaded, mass), out)


@commands.command()
def diagnose(folder: RunPath) -> None:
    """Test each link parameter that the robot file leaves out, and those that it states."""
    from hil.results import diagnosis  # noqa: PLC0415 - slow to import, used here only
    from hil.terminal import diagnosis_view  # noqa: PLC0415 - slow to import, used here only

    found = diagnosis.diagnose(folder)
    diagnosis_view.render(found, out)
    out.print(f"plots in {diagnosis.write_plots(folder, found)}", highlight=False, soft_wrap=True)
