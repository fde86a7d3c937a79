"""Quantities of a machine over its runs, with intervals; what is marked stands out."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from hil.report.plots.style import MEASURED, MODEL, MUTED, legend, panels_in_rows
from hil.results.history_file import half_width
from hil.results.tables.cells import unit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from hil.results.history import History

DAY = 86400.0


def over_time(found: History, places: Sequence[int]) -> Figure:
    """Draw the quantities at `places`, a panel each."""
    figure, panels = panels_in_rows(len(places), 1.9)
    at, label = _instants(found)
    for place, (panel,) in zip(places, panels, strict=True):
        _draw(panel, found, place, at)
        panel.set_xlabel(label)
    legend(figure, panels[0][0])
    return figure


def _instants(found: History) -> tuple[np.ndarray, str]:
    """Places of the runs along the axis: days, or their numbers where a run has no instant."""
    stamps = [run.measured for run in found.runs]
    if not all(stamps):
        return np.arange(1.0, len(stamps) + 1), "run"
    seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
    return (seconds - seconds[0]) / DAY, "days since the first run"


def _draw(panel: Axes, found: History, place: int, at: np.ndarray) -> None:
    quantity = found.quantities[place]
    readings = [run.readings[place] for run in found.runs]
    marked = {each.run for each in found.marked if each.quantity == quantity}
    groups = (("as before", MEASURED, False), ("changed", MODEL, True))
    for name, colour, changed in groups:
        shown = [
            (t, read.value, half_width(read), read.allowance)
            for t, run, read in zip(at, found.runs, readings, strict=True)
            if read is not None and (run.label in marked) == changed
        ]
        t, value, half, allowance = np.array(shown).reshape(-1, 4).T
        panel.errorbar(t, value, half, fmt="o", ms=3, lw=1, color=colour, label=name)
        panel.errorbar(t, value, half + allowance, fmt="none", lw=0.5, color=MUTED)
    panel.set_title(quantity.name)
    panel.set_ylabel(unit(quantity.unit))
