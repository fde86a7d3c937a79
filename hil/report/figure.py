"""Charts of models and recordings as notebook figures: SVG, as in a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.commands.torques import torque_chart
from hil.errors import FileError, NotEnoughData
from hil.model.base_parameters import base_parameters
from hil.report.sections.friction import levels
from hil.runs.atomic_file import write_file
from hil.runs.run import opened
from hil.show.charts.chart import MODEL, Band, Chart, Line, Panel, Points, Rule
from hil.show.charts.svg import file
from hil.view.along_motion import stretches

if TYPE_CHECKING:
    from hil.results.model import Model
    from hil.runs.run import Run

SPEEDS = 200
"""Number of speeds at which a friction law is drawn."""
MOST = 2000
"""Maximum number of samples drawn, the columns of a screen."""


@dataclass(frozen=True, eq=False)
class Figure:
    """Chart displayed by a notebook and saved by `savefig`.

    Attributes
    ----------
    chart : Chart

    Examples
    --------
    >>> figure = hil.plot_friction(hil.Model.load("runs/head"))
    >>> figure.savefig("friction.svg").name
    'friction.svg'
    """

    chart: Chart

    @property
    def svg(self) -> str:
        """Chart as SVG."""
        return file(self.chart).decode()

    def savefig(self, path: Path | str) -> Path:
        """Write the chart as an SVG file, and return its path.

        Raises
        ------
        FileError
            The path does not end in ``.svg``, or is not writable.
        """
        path = Path(path)
        if path.suffix.lower() != ".svg":
            raise FileError(f"{path}: figures are SVG; choose {path.with_suffix('.svg').name}")
        write_file(path, self.svg.encode())
        return path

    def _repr_svg_(self) -> str:
        return self.svg

    def _repr_html_(self) -> str:
        return f'<div style="max-width: 1100px; overflow-x: auto">{self.svg}</div>'

    def __repr__(self) -> str:
        titles = ", ".join(panel.title for panel in self.chart.panels)
        return f"<Figure: {titles}>"


def plot_torque(model: Model, run: Run | Path | str, measurement: str | None = None) -> Figure:
    """Draw measured and predicted torque over time, with the prediction's interval of 95 %.

    Parameters
    ----------
    model : Model
    run : Run or path
    measurement : str, optional
        Id of the measurement; by default the first predictable one.

    Raises
    ------
    UnknownName, NotEnoughData
        The measurement does not exist, or none is usable.

    Examples
    --------
    >>> hil.plot_torque(hil.Model.load("runs/first"), "runs/first", "g02")
    <Figure: axis 2, g02>
    """
    run = opened(run)
    for each in [run[measurement]] if measurement else run:
        if found := stretches(model, [(each.measurement, each.recording)]):
            shown = [stretch.part(0.0, np.inf, MOST) for stretch in found.values()]
            return Figure(Chart(tuple(torque_chart(shown, model.robot))))
    raise NotEnoughData(f"{run.path}: no recording with torques predicted by a model")


def plot_friction(model: Model) -> Figure:
    """Draw the friction law of every axis over speed, with the 95 % interval.

    Raises
    ------
    NotEnoughData
        The model has no friction law.

    Examples
    --------
    >>> hil.plot_friction(hil.Model.load("runs/head"))
    <Figure: axis 1, axis 2>
    """
    robot = model.robot
    panels = []
    for axis in range(robot.n_joints):
        if axis + 1 in model.axes_without_friction:
            continue
        top = float(robot.velocity_limit[axis])
        top = top if np.isfinite(top) else 1.0
        qd = np.zeros((SPEEDS, robot.n_joints))
        qd[:, axis] = np.linspace(-top, top, SPEEDS)
        q = np.zeros_like(qd)
        tau = model.predict(q, qd, 0.0, ["friction"])[:, axis]
        low, high = model.torque_interval(q, qd, 0.0, parts=["friction"])[:, axis].T
        speed = qd[:, axis]
        panels.append(
            Panel(
                (
                    Band(speed, low, high, label="95 % interval"),
                    Line(speed, tau, MODEL, "law of friction"),
                ),
                title=f"axis {axis + 1}",
                x_label=f"speed [{robot.position_unit(axis)}/s]",
                y_label=f"friction [{robot.torque_unit(axis)}]",
            )
        )
    if not panels:
        model.predict(np.zeros(robot.n_joints), 0.0, 0.0, ["friction"])  # raises the reason
    return Figure(Chart(tuple(panels)))


def plot_friction_over_time(model: Model) -> Figure:
    """Draw the friction level of every measurement in a campaign.

    Raises
    ------
    NotEnoughData
        No single measurement is known, as for imports and trajectories.

    Examples
    --------
    >>> hil.plot_friction_over_time(hil.Model.load("runs/first"))
    <Figure: axis 1, axis 2, axis 3, axis 4, axis 5, axis 6>
    """
    if not model.local:
        model.friction_over_time(1)  # raises the reason
    return Figure(Chart(tuple(levels(model.local, model.robot))))


def plot_parameters(model: Model) -> Figure:
    """Draw the standard errors of base parameters relative to the values.

    Beyond 100 % the sign is uncertain, as for parameters that are zero.

    Examples
    --------
    >>> hil.plot_parameters(hil.Model.load("runs/head"))
    <Figure: pan-tilt: 2 measurements>
    """
    size = np.where(model.values != 0, np.abs(model.values), np.nan)
    share = 100 * model.standard_errors / size
    known = np.isfinite(share)
    rows = -np.arange(len(size), dtype=float)
    return Figure(Chart((Panel(
        (Rule(100.0, upright=True), Points(share[known], rows[known], "o", MODEL)),
        title=f"{model.robot.name}: {model.provenance.measurements} measurements",
        x_label="standard error [% of the value]",
        rows=dict(zip(rows.tolist(), base_parameters(model.robot).titles, strict=True)),
        y_range=(-len(size) + 0.5, 0.5),
        decades=True,
        height=16.0 * len(size),
    ),)))  # fmt: skip
