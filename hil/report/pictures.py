"""Pictures that commands write as PNG files: of a validation, a tracking, a watch.

Figures are made with matplotlib's objects alone. There is no global state to set up or to leave
behind but the style, which holds within `plotting`. Margins are fixed in inches, since engines that
find them out take most of the time that a figure takes.
"""

from __future__ import annotations

import io
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hil.least_squares.uncertainty import TWICE
from hil.report import VALIDATION
from hil.report.charts.axis import drawn
from hil.report.charts.chart import GRID, INK, MEASURED, MODEL, MUTED
from hil.results.tracking import PASSES, following_error, trajectories
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from matplotlib.axes import Axes

    from hil.results.recorded_torque import PredictedTorque
    from hil.results.validation import Validation
    from hil.runs.run import Run
    from hil.watching.trace import Trace

STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.titlesize": 9.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.titley": 1.0,  # else every draw looks for a place above all that stands there
    "axes.labelsize": 9, "axes.edgecolor": MUTED, "axes.labelcolor": INK, "text.color": INK,
    "axes.linewidth": 0.7, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": GRID, "grid.linewidth": 0.7, "axes.axisbelow": True,
    "xtick.color": INK, "ytick.color": INK, "xtick.labelsize": 8, "ytick.labelsize": 8,
    "lines.linewidth": 1.1, "legend.frameon": False, "legend.fontsize": 8.5,
    "figure.facecolor": "white", "svg.hashsalt": "hil",
}  # fmt: skip


@contextmanager
def plotting() -> Iterator[None]:
    """Style of everything drawn and saved within."""
    with mpl.rc_context(STYLE):
        yield


def image(figure: Figure, kind: str) -> bytes:
    """Write a figure as ``svg`` or ``png``, the latter with 160 points an inch."""
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    figure.savefig(content, format=kind, dpi=160, metadata=metadata)
    return content.getvalue()


def _panels(n: int, height: float, strip: float = 0.0) -> tuple[Figure, list[tuple[Axes, ...]]]:
    """A figure with `n` panels, up to three in a row, each with a strip of details below or not.

    It is 10 inches wide, or 6 for one panel, with fixed margins; reports scale it to the page.
    """
    columns = 2 if n == 4 else min(max(n, 1), 3)
    rows = max(-(-n // columns), 1)
    width, height = 10.0 if columns > 1 else 6.0, 0.3 + height * rows
    figure = Figure(figsize=(width, height))
    inner = (width - 0.75 - (columns - 1) * 0.85) / columns, (height - 1.05) / rows
    inner = inner[0], inner[1] - (rows - 1) / rows * 0.75
    grid = figure.add_gridspec(
        rows, columns,
        left=0.65 / width, right=1 - 0.1 / width, bottom=0.5 / height, top=1 - 0.55 / height,
        wspace=0.85 / inner[0], hspace=0.75 / inner[1],
    )  # fmt: skip
    panels: list[tuple[Axes, ...]] = []
    for k in range(n):
        cell = grid[divmod(k, columns)]
        if strip:
            below = cell.subgridspec(2, 1, height_ratios=[1.0, strip], hspace=0.12)
            above = figure.add_subplot(below[0])
            panels.append((above, figure.add_subplot(below[1], sharex=above)))
        else:
            panels.append((figure.add_subplot(cell),))
    return figure, panels


def _legend(figure: Figure, panel: Axes) -> None:
    """Explain the marks of `panel` above all panels."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=len(handles))


def _written(path: Path, draw: Callable[[], Figure]) -> Path:
    with plotting():
        write_file(path, image(draw(), "png"))
    return path


class Drawn:
    """Passes predictions on and keeps of each axis the first stretch, to be drawn."""

    def __init__(self, predicted: Iterable[PredictedTorque]) -> None:
        self._predicted = predicted
        self.first: dict[int, PredictedTorque] = {}

    def __iter__(self) -> Iterator[PredictedTorque]:
        for each in self._predicted:
            self.first.setdefault(each.axis, each)
            yield each


def write_validation_plot(
    folder: Path, found: Validation, first: dict[int, PredictedTorque]
) -> Path:
    """Draw a validation into a run's folder; return the file's path.

    Of every axis the first 20 s from where it moves first, and below it the residual; with the 95 %
    interval of the prediction.
    """
    return _written(folder / VALIDATION, lambda: _validation(found, first))


def _validation(found: Validation, first: dict[int, PredictedTorque]) -> Figure:
    figure, panels = _panels(len(found.axes), 2.6, strip=0.45)
    for score, (above, below) in zip(found.axes, panels, strict=True):
        each = first[score.axis - 1]
        begun = each.time <= each.time[0] + 20.0
        shown, t, hole = drawn(each.time[begun])
        measured, predicted = each.measured[begun][shown], each.predicted[begun][shown]
        width, residual = TWICE * each.standard_error[begun][shown], measured - predicted + hole
        above.plot(t, measured + hole, color=MEASURED, label="measured")
        above.plot(t, predicted + hole, "--", color=MODEL, label="predicted")
        below.plot(t, residual, color=MUTED, linewidth=0.7)
        look: dict[str, Any] = {"color": MODEL, "alpha": 0.25, "linewidth": 0}
        low = predicted - width
        above.fill_between(t, low, low + 2 * width, label="95 % interval", **look)
        below.fill_between(t, -width, width, **look)
        size = 1.1 * float(np.nanmax(np.abs(residual), initial=1e-9))
        below.set(ylim=(-size, size), ylabel="residual", xlabel="time [s]")
        above.tick_params(labelbottom=False)
        above.set_ylabel(f"axis {score.axis} [{score.unit}]")
        above.set_title(f"off by {score.relative:.1%}")
    _legend(figure, panels[0][0])
    return figure


PASS_LINES = {
    "neither": ("neither", MUTED),
    "velocity": ("velocity", MODEL),
    "both": ("velocity and torque", MEASURED),
}
"""Label and colour of each pass of a tracking."""


def write_tracking_plot(folder: Path, runs: dict[str, Run], delay: float) -> Path:
    """Draw a tracking into a folder; return the file's path.

    The first period of the first trajectory; below it the smaller errors by themselves.

    Parameters
    ----------
    runs : dict
        By name of the pass.
    delay : float
        See `hil.results.tracking`.
    """
    return _written(folder / "tracking.png", lambda: _tracking(runs, delay))


def _tracking(runs: dict[str, Run], delay: float) -> Figure:
    robot = runs[PASSES[0]].robot
    figure, panels = _panels(robot.n_joints, 2.6, strip=0.8)
    for name in PASSES:
        trajectory, recording = trajectories(runs[name])[0]
        time, error, _ = following_error(recording, trajectory, delay)
        shown, (label, colour) = time <= trajectory.period, PASS_LINES[name]
        for axis, (above, below) in enumerate(panels):
            for panel in (above,) if name == "neither" else (above, below):
                panel.plot(time[shown], 1e3 * error[shown, axis], color=colour, label=label)
    for axis, (above, below) in enumerate(panels):
        above.set_title(f"axis {axis + 1}")
        above.set_ylabel(f"[m{robot.position_unit(axis)}]")
        above.tick_params(labelbottom=False)
        below.set_xlabel("time [s]")
    _legend(figure, panels[0][0])
    return figure


def write_watch_plot(folder: Path, trace: Trace, units: tuple[str, ...] = ()) -> Path:
    """Draw what is around each axis's first alarm, or the end of a watch; return the file."""
    return _written(folder / "watch.png", lambda: _watch(trace, units))


def _watch(trace: Trace, units: tuple[str, ...]) -> Figure:
    stretches = trace.stretches()
    figure, panels = _panels(len(stretches), 2.3)
    for axis, (stretch, (panel,)) in enumerate(zip(stretches, panels, strict=True)):
        seen = np.where(np.isfinite(stretch.threshold), stretch.threshold, np.nan)
        low, high = (stretch.predicted + side * seen for side in (-1, 1))
        panel.fill_between(
            stretch.time, low, high, color=MODEL, alpha=0.2, lw=0, label="within the threshold"
        )
        panel.plot(stretch.time, stretch.measured, color=MEASURED, label="measured")
        panel.plot(stretch.time, stretch.predicted, color=MODEL, label="predicted")
        if np.isfinite(stretch.alarm):
            panel.axvline(stretch.alarm, color=MUTED, ls="--", label="alarm")
        panel.set_title(f"axis {axis + 1}")
        panel.set_xlabel("time [s]")
        panel.set_ylabel(f"torque [{units[axis]}]" if units else "torque")
    if panels:
        shown = max(panels, key=lambda each: len(each[0].get_lines()))
        _legend(figure, shown[0])
    return figure
