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
    """Find a load from two runs, without and with it; writes payload.yaml into the second."""
    from hil.results import load, load_file  # noqa: PLC0415 - slow to import, used here only
    from hil.terminal import load_view  # noqa: PLC0415 - slow to import, used here only

    found = load.find_load(without, loaded, mass)
    load_view.render(found, out)
    _tell("load", load_file.write_load(without, loaded, found), loaded)


@commands.command()
def diagnose(folder: RunPath) -> None:
    """Test what the robot file leaves out and what it states; writes diagnosis.yaml."""
    from hil.results import diagnosis, diagnosis_file  # noqa: PLC0415 - slow to import
    from hil.terminal import diagnosis_view  # noqa: PLC0415 - slow to import, used here only

    found = diagnosis.diagnose(folder)
    diagnosis_view.render(found, out)
    plots = diagnosis_file.write_plots(folder, found)
    out.print(f"plots in {plots}", highlight=False, soft_wrap=True)
    _tell("diagnosis", diagnosis_file.write_diagnosis(folder, found), folder)


def _tell(what: str, path: Path, folder: Path) -> None:
    out.print(f"{what} in {path}; hil report {folder} shows it", highlight=False, soft_wrap=True)
