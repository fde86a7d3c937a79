"""What was identified of axes that move back and forth: parameters, half-sums, friction."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.report.plots.back_and_forth import friction_curves, shown_half_sums
from hil.report.section import Plot, Section
from hil.results.tables.back_and_forth import curves, left_by_strokes, plain, statements
from hil.results.tables.friction import campaign_friction
from hil.results.tables.parameters import parameters

if TYPE_CHECKING:
    from hil.report.reported_run import ForeignRun


def section(run: ForeignRun) -> Section | None:
    """Tables and what was chosen, half-sums beside the model, half-differences as curves."""
    model = run.model
    if model.back_and_forth is None:
        return None
    plots = (
        Plot(
            "half-sums",
            partial(shown_half_sums, run.estimate.half_sums, run.robot),
            "Torque of the rigid bodies over the position of each axis, measured and modelled.",
            "Half the sum of the torques forth and back over the position, less what differs by"
            " direction: gravity and, where the axis accelerates, its inertia. Means over the pairs"
            " with standard errors, of the recordings with the longest ways, each in a colour;"
            " lines are the model.",
        ),
        Plot(
            "friction-curves",
            partial(friction_curves, model.back_and_forth.curves, run.robot),
            "Friction of each axis over its speed with intervals of 95 %.",
            "Half the difference of the torques, less the rigid bodies' part of it: friction over"
            " the speed, means over the pairs with intervals of 95 %. Dashed: Coulomb and viscous"
            " alone.",
        ),
    )
    return Section(
        "Parameters, friction and torques",
        "back_and_forth.html",
        {
            "parameters": parameters(model),
            "curves": curves(model),
            "plain": plain(model),
            "law": campaign_friction(model),
            "left": left_by_strokes(model),
            "statements": statements(model.back_and_forth),
            "lengths": run.robot.file.lengths,
        },
        plots,
        leads=True,
    )
