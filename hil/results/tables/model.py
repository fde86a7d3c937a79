"""Tables of an identified model, with remarks on its restrictions, by identification method."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.free_motion.result import FreeMotionFit
from hil.friction.ripple import ripple_left_out
from hil.results.identified_robot import lacking
from hil.results.tables.friction import campaign_friction
from hil.results.tables.imported import (
    curves,
    friction,
    left_by_fit,
    plain,
    statements,
    statements_of_strokes,
)
from hil.results.tables.parameters import band_residual, parameters, residuals
from hil.show.outcome import Outcome

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.results.identified_robot import IdentifiedRobot
    from hil.show.table import Table


def summary(model: IdentifiedRobot) -> Outcome:
    """Return tables of parameters with uncertainties, of residuals and of unused measurements."""
    found = _summary(model)
    if model.refinement is None:
        return found
    return replace(found, tables=(*found.tables, model.refinement.table(model.robot)))


def _summary(model: IdentifiedRobot) -> Outcome:
    left = band_residual(model.band_residual, model.robot, "of these recordings")
    remarks = tuple(f"left out: {left}" for left in model.provenance.left_out)
    if model.prior is not None and model.prior.replaced:
        remarks = (str(model.prior), *remarks)
    if isinstance(fit := model.details, FreeMotionFit):
        tables = parameters(model), friction(fit, model.robot), left_by_fit(model), left
        return Outcome(_filled(tables), (*statements(fit), *remarks))
    if isinstance(fit, BackAndForthFit):
        own = curves(fit, model.robot), plain(fit, model.robot)
        found = parameters(model), *own, left_by_fit(model), left
        return Outcome(_filled(found), (*statements_of_strokes(fit), *remarks))
    if lack := lacking(model):
        remarks = (*remarks, lack)
    if model.method == "improved" and (ripple := ripple_left_out(model.robot)):
        remarks = (*remarks, ripple)
    tables = parameters(model), residuals(model), left, campaign_friction(model)
    return Outcome(_filled(tables), remarks)


def _filled(tables: Iterable[Table]) -> tuple[Table, ...]:
    return tuple(table for table in tables if table.parts)
