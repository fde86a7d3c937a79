"""Friction sections: over a campaign from step 1, and from friction measurements."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.commands.friction import models
from hil.estimation.friction.symmetry import judge_local_values
from hil.report.sections import friction_plots as plots
from hil.results.identified_robot import lacking
from hil.results.tables import friction as tables
from hil.results.tables.friction import campaign_friction
from hil.show.section import Plot, Section

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.commands.friction import FrictionResult
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.report.reported_run import ReportedRun


def friction_over_campaign(run: ReportedRun) -> Section | None:
    """Create the section of friction over a campaign: law, levels, drift and symmetry."""
    if run.found.effect is None:
        return None
    local = run.estimate.local
    return Section(
        "Friction over the campaign",
        "friction_over_campaign.html",
        {
            "law": campaign_friction(run.model),
            "lack": lacking(run.model),
            "drift": tables.drift(run.found.drifts),
            "symmetry": tables.symmetry(judge_local_values(local)),
        },
        (_levels_plot(run.estimate, run.robot),) if local else (),
    )


def _levels_plot(estimate: Estimate, robot: Robot) -> Plot:
    return Plot(
        "friction",
        partial(plots.levels, estimate.local, robot),
        "Friction level of every axis over robot time, one panel per axis, markers by kind of "
        "measurement.",
        "Friction level of each axis, found with each element in step 1. Levels of different "
        "kinds come from different fits and may differ by a step; the course of one kind is "
        f"drift by temperature and lubricant. {friction_change(estimate)} No effect on the "
        "parameters: friction is fitted anew in every measurement.",
    )


def friction_change(estimate: Estimate) -> str:
    """Describe the largest change of the friction level within a kind of measurement."""
    spread = {}
    for axis, kind in sorted({(v.axis, v.kind) for v in estimate.local}):
        found = [v.friction for v in estimate.local if (v.axis, v.kind) == (axis, kind)]
        if min(found) > 0:
            spread[axis, kind] = max(found) / min(found) - 1.0
    if not spread:
        return "Levels near zero allow no statement on drift."
    (axis, kind), most = max(spread.items(), key=lambda item: item[1])
    return (
        f"At axis {axis + 1} the {kind} measurements alone find levels that differ by"
        f" {100 * most:.0f} %."
    )


def friction(run: ReportedRun) -> Section | None:
    """Create the section of a run's friction measurements; None if absent."""
    result = run.friction
    if result is None:
        return None
    values = {
        "result": result,
        "models": models(result),
        "symmetry": tables.symmetry(result.symmetry),
        "drift": tables.drift(result.drifts),
    }
    shown = tuple(_friction_plots(result))
    if result.axes and run.is_identified:
        shown = (models_plot(result), *shown)
    return Section("Friction", "friction.html", values, shown)


def models_plot(result: FrictionResult) -> Plot:
    """Create the plot of friction over speed."""
    return Plot(
        "models",
        partial(plots.models, result),
        "Friction over speed with fitted models, one panel per axis.",
        "Measured friction and the models fitted to it (Fig. 1b); thick: the chosen model.",
    )


def _friction_plots(result: FrictionResult) -> Iterator[Plot]:
    if result.drifts:
        yield Plot(
            "over-time",
            partial(plots.draw_levels, result.drifts),
            "Friction level over time, one panel per axis.",
            "Friction level in the course of time (Fig. 2a).",
        )
    if plots.axes_in_operation(result):
        yield Plot(
            "in-operation",
            partial(plots.operation_curves, result),
            "Friction characteristics after several durations of operation.",
            "Friction characteristics after several durations of continuous operation (Fig. 2b).",
        )
