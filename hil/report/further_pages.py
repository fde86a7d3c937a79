"""Pages beside reports, one HTML file each: of an acceptance, to be signed, and of a history.

A history draws quantities of a machine over its runs, with intervals; what is marked stands out.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.intervals import SIGNIFICANT
from hil.report.charts.chart import MEASURED, MODEL, MUTED, Chart, Panel, Points
from hil.report.page import when, write_html
from hil.report.section import Plot
from hil.results import history_file as tables
from hil.results.acceptance import checked
from hil.results.history_file import half_width
from hil.results.rounding import unit
from hil.results.tables.table import Column, Table, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from hil.results.acceptance import Acceptance
    from hil.results.history import History
    from hil.results.quantities import Kind
    from hil.runs.run import Run

NOT_KNOWN = "not stated"


def write_acceptance_page(
    path: Path, run: Run, found: Acceptance, stated: Mapping[str, str]
) -> None:
    """Write the page, whole or not at all; `stated`: facts that the run does not hold."""
    sessions = run.journal.sessions
    facts = {
        **{name: text or NOT_KNOWN for name, text in stated.items()},
        "Measured": when(sessions[-1].started) if sessions else NOT_KNOWN,
        "Bus": sessions[-1].bus if sessions else NOT_KNOWN,
    }
    write_html(
        path,
        "acceptance.html",
        robot=run.robot.name,
        word=found.word,
        failed=sum(check.word == "failed" for check in found.checks),
        count=len(found.checks),
        facts=facts.items(),
        tables=[each for each in (checked(found), _drives(run)) if each],
        simulated=run.journal.simulated,
    )


def _drives(run: Run) -> Table:
    axes = next((session.axes for session in run.journal.sessions if session.axes), ())
    rows = ((axis.name, axis.identity) for axis in axes)
    return table("Drives", ("axis", Column("identity", folds=True)), rows)


_CAPTION = "Values with intervals of 95 %, thin lines with what temperature may add to friction."


def write_history_page(path: Path, found: History) -> None:
    """Write the page, whole or not at all."""
    write_html(
        path,
        "history.html",
        robot=found.robot.name,
        newest=found.runs[-1].label,
        marked=found.sentences(found.runs[-1]),
        tables=[each(found) for each in (tables.runs, tables.changes, tables.condition)],
        plots=list(_history_plots(found)),
        rate=f"{SIGNIFICANT:.0%}",
    )


def _history_plots(found: History) -> Iterator[Plot]:
    """A plot of each kind of quantity that the runs know."""
    names: dict[Kind, str] = {
        "gravity parameter": "Gravity parameters", "inertia parameter": "Inertia parameters",
        "friction level": "Friction", "offset": "Offsets",
    }  # fmt: skip
    for kind, name in names.items():
        places = [k for k, each in enumerate(found.quantities) if each.kind == kind]
        if places:
            yield Plot(
                kind.replace(" ", "-"),
                lambda places=places: over_time(found, places),  # type: ignore[misc]
                f"{name} over time, a panel each",
                f"{name} over time. {_CAPTION}",
            )


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
    return (seconds - seconds[0]) / 86400.0, "days since the first run"


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
