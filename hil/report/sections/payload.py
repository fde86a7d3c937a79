"""The load that `hil payload` found: Table 3, the load itself, the paper's Figs. 5 and 6."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.kept_result import current
from hil.report.plots.payload import with_and_without_load
from hil.report.section import Plot, Section
from hil.results.load_file import DRAWN, NAME, read_load
from hil.results.tables import payload as tables

if TYPE_CHECKING:
    from hil.model.robot import Robot
    from hil.report.reported_run import ForeignRun, IdentifiedRun
    from hil.results.load_file import LoadFile


def section(run: IdentifiedRun | ForeignRun) -> Section | None:
    """What is kept of a load, or why it is not shown."""
    load, note = current(read_load, run, NAME, f"hil payload WITHOUT {run.source.path}")
    if load is None and not note:
        return None
    # of imported motions there are no elements by themselves to draw
    plots = (
        tuple(_plot(name, load, run.robot) for name in DRAWN) if load and not load.imported else ()
    )
    values = {"load": load, "note": note, "tables": tables}
    return Section("The load", "payload.html", values, plots)


def _plot(name: str, load: LoadFile, robot: Robot) -> Plot:
    kind = ELEMENT_KINDS[name]
    elements = kind.elements.capitalize()
    return Plot(
        f"load-{name}",
        partial(with_and_without_load, load.elements_without, load.elements_loaded, kind, robot),
        f"{elements} without and with load over configuration number, one panel an axis.",
        f"{elements} without and with load, measured and modelled ({kind.figure}).",
    )
