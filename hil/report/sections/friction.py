"""Friction by its own measurements: models, symmetry, variance in time (Figs. 1 and 2)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.report.plots import friction as plots
from hil.report.section import Plot, Section
from hil.results.tables import friction as tables

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.report.reported_run import ReportedRun
    from hil.results.friction_file import FrictionResult


def section(run: ReportedRun) -> Section | None:
    """All that a run's friction measurements show; None where it has none."""
    result = run.friction
    if result is None:
        return None
    values = {
        "result": result,
        "models": tables.models(result),
        "symmetry": tables.symmetry(result.symmetry),
        "drift": tables.drift(result.drifts),
    }
    return Section("Friction", "friction.html", values, tuple(_plots(result)), leads=True)


def _plots(result: FrictionResult) -> Iterator[Plot]:
    if result.axes:
        yield Plot(
            "normalised",
            partial(plots.normalised, result),
            "Friction over speed, normalised, one line an axis.",
            "Friction characteristics of all axes, normalised to speed limit and largest friction"
            " (the paper's Fig. 1a).",
        )
        yield Plot(
            "models",
            partial(plots.models, result),
            "Friction over speed with fitted models, one panel an axis.",
            "Measured friction and the models fitted to it (Fig. 1b); the chosen one is drawn"
            " thick.",
        )
    if result.drifts:
        yield Plot(
            "over-time",
            partial(plots.over_time, result.drifts),
            "Friction level over time, one panel an axis.",
            "Friction level in the course of time (Fig. 2a).",
        )
    if plots.axes_in_operation(result):
        yield Plot(
            "in-operation",
            partial(plots.in_operation, result),
            "Friction characteristics after several times of operation.",
            "Friction characteristics after several times of continuous operation (Fig. 2b).",
        )
