"""What runs give: a model, a report, a load, a diagnosis; and how true the model is."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from hil.cli.arguments import RunPath
from hil.terminal.console import out

commands = typer.Typer()


class Method(StrEnum):
    """How parameters are estimated."""

    IMPROVED = "improved"
    PRINTED = "printed"


@commands.command()
def identify(
    folder: RunPath,
    method: Annotated[Method, typer.Option(help="Variant of the estimator.")] = Method.IMPROVED,
    others: Annotated[
        list[Path] | None,
        typer.Option(
            "--with", help="Further run that is identified together with it; may be repeated."
        ),
    ] = None,
) -> None:
    """Estimate base parameters from a run; writes model.yaml into its folder."""
    from hil.cli import estimate_view
    from hil.estimation.friction.symmetry import of_local_values
    from hil.model.robot import load_robot
    from hil.results import model_file
    from hil.results.tables.friction import symmetry
    from hil.results.tables.terminal import show

    begun = perf_counter()
    found = model_file.identify(folder, method.value, others or ())
    estimate_view.render(found, load_robot(folder / "robot.yaml"), out)
    show(symmetry(of_local_values(found.local)), out)
    for each in (folder, *(others or ())):
        _show_shortfall(each)
    took = f"{perf_counter() - begun:.1f} s"
    out.print(f"model in {folder / model_file.NAME} ({took})", highlight=False, soft_wrap=True)


@commands.command()
def report(
    folder: RunPath,
    figures: Annotated[
        Path | None, typer.Option(help="Folder that the plots are written to as PNG files too.")
    ] = None,
) -> None:
    """Write a run's report, one HTML file."""
    from hil.report import page as module

    begun = perf_counter()
    path = module.report(folder, figures)
    _show_shortfall(folder)
    out.print(f"report in {path} ({perf_counter() - begun:.1f} s)", highlight=False, soft_wrap=True)


@commands.command()
def compare(
    folder: RunPath,
    truth: Annotated[
        str,
        typer.Option(help="Plant file of the virtual plant, or name of a plant that comes along."),
    ],
    method: Annotated[Method, typer.Option(help="Variant of the estimator.")] = Method.IMPROVED,
) -> None:
    """Set an estimate against the truth of the virtual plant."""
    from hil.study import comparison as module

    module.compare(folder, truth, out, method.value)


@commands.command()
def payload(
    without: Annotated[Path, typer.Argument(help="Folder of the run without the load.")],
    loaded: Annotated[Path, typer.Argument(help="Folder of the run with the load.")],
    mass: Annotated[
        float | None,
        typer.Option(
            min=1e-3,
            help="Mass of the load, from which the torque constants are estimated too \\[kg].",
        ),
    ] = None,
) -> None:
    """Find a load from two runs, without and with it; writes payload.yaml into the second."""
    from hil.cli import payload_view
    from hil.results import payload, payload_file

    found = payload.find_load(without, loaded, mass)
    payload_view.render(payload_file.write_load(without, loaded, found), out)
    _show_place("load", loaded / payload_file.NAME)


@commands.command()
def diagnose(folder: RunPath) -> None:
    """Test what the robot file leaves out and what it states; writes diagnosis.yaml."""
    from hil.cli import diagnosis_view
    from hil.report.plots.diagnosis import (
        write_diagnosis_plots,
    )
    from hil.results import diagnosis, diagnosis_file

    found = diagnosis.diagnose(folder)
    diagnosis_view.render(diagnosis_file.write_diagnosis(folder, found), found.estimate, out)
    plots = write_diagnosis_plots(folder, found)
    out.print(f"plots in {plots}", highlight=False, soft_wrap=True)
    _show_place("diagnosis", folder / diagnosis_file.NAME)


def _show_shortfall(folder: Path) -> None:
    from hil.runs.run_folder import RunFolder

    shortfall = RunFolder.open(folder).shortfall
    if shortfall:
        out.print(f"[yellow]{shortfall}[/]", soft_wrap=True)


def _show_place(what: str, path: Path) -> None:
    out.print(
        f"{what} in {path}; hil report {path.parent} shows it", highlight=False, soft_wrap=True
    )
