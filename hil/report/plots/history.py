"""Quantities of a machine over its runs, with intervals; what is marked stands out."""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from hil.report.charts.chart import Chart, Panel, Points
from hil.report.charts.colours import MEASURED, MODEL, MUTED
from hil.results.history_file import half_width
from hil.results.rounding import unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.results.compared_runs import History

DAY = 86400.0


def over_time(found: History, places: Sequence[int]) -> Chart:
    """Draw the quantities at `places`, a panel each."""
    at, label = _instants(found)
    return Chart(
        tuple(
            Panel(
                tuple(_readings(found, place, at)),
                title=found.quantities[place].name,
                x_label=label,
                y_label=unit(found.quantities[place].unit),
                height=105.0,
            )
            for place in places
        )
    )


def _instants(found: History) -> tuple[np.ndarray, str]:
    """Places of the runs along the axis: days, or their numbers where a run has no instant."""
    stamps = [run.measured for run in found.runs]
    if not all(stamps):
        return np.arange(1.0, len(stamps) + 1), "run"
    seconds = np.array([datetime.fromisoformat(stamp).timestamp() for stamp in stamps])
    return (seconds - seconds[0]) / DAY, "days since the first run"


def _readings(found: History, place: int, at: np.ndarray) -> Iterator[Points]:
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
        if shown:
            yield Points(t, value, "o", MUTED, error=half + allowance, size=0.5)
            yield Points(t, value, "o", colour, name, error=half, size=2.4)
