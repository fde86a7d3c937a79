"""The plot of a validation: measured and predicted torque of every axis, and what is left."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.least_squares.uncertainty import TWICE
from hil.report.plots import VALIDATION
from hil.report.plots.predicted_torque import draw_prediction
from hil.report.plots.style import image, legend, panels_in_rows, plotting
from hil.runs.atomic_file import write_file

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from hil.results.predicted_torques import PredictedTorque
    from hil.results.validation import Validation

SHOWN = 20.0
"""Of each axis's recordings, from where it moves first [s]."""


class Drawn:
    """Passes predictions on and keeps of each axis the first stretch, to be drawn."""

    def __init__(self, predicted: Iterable[PredictedTorque]) -> None:
        self._predicted = predicted
        self.first: dict[int, PredictedTorque] = {}

    def __iter__(self) -> Iterator[PredictedTorque]:
        for each in self._predicted:
            self.first.setdefault(each.axis, each)
            yield each


def validation(found: Validation, first: dict[int, PredictedTorque]) -> Figure:
    """Draw the first stretch of every axis, and below it the residual."""
    figure, panels = panels_in_rows(len(found.axes), 2.6, strip=0.45)
    for score, (above, below) in zip(found.axes, panels, strict=True):
        each = first[score.axis - 1]
        shown = each.time <= each.time[0] + SHOWN
        width = TWICE * each.standard_error[shown]
        draw_prediction(
            above, below, each.time[shown], each.measured[shown], each.predicted[shown], width
        )
        above.set_ylabel(f"axis {score.axis} [{score.unit}]")
        above.set_title(f"off by {score.relative:.1%}")
    legend(figure, panels[0][0])
    return figure


def write_validation_plot(
    folder: Path, found: Validation, first: dict[int, PredictedTorque]
) -> Path:
    """Draw a validation into a run's folder; return the file's path."""
    path = folder / VALIDATION
    with plotting():
        write_file(path, image(validation(found, first), "png"))
    return path
