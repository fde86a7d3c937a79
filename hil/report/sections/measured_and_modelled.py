"""Measured elements of g(q) and M(q) against those of the model: the paper's Figs. 5 and 6."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.plots.measured_elements import measured_elements
from hil.report.section import Plot, Section

if TYPE_CHECKING:
    from hil.planning.measurement import ElementKind
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section | None:
    """One plot a kind that was measured."""
    kinds = {value.kind for value in run.estimate.local}
    plots = tuple(_plot(name, kind, run) for name, kind in ELEMENT_KINDS.items() if name in kinds)
    if not plots:
        return None
    return Section("Measured and modelled", "measured_and_modelled.html", plots=plots)


def _plot(name: str, kind: ElementKind, run: IdentifiedRun) -> Plot:
    return Plot(
        name,
        partial(measured_elements, run.local_values(name), kind, run.robot),
        f"Measured and modelled {kind.elements} over configuration number, one panel"
        f" {'a pair of axes' if kind.pair else 'an axis'}, with their differences below.",
        kind.caption,
    )
