"""The sections of reports, each a module and a template of its name, and their order.

A section is one function, from a run to what the section shows or to None where there is nothing to
show. A new one is a module, its template and a line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.sections import (
    advice,
    back_and_forth,
    bodies,
    correlations,
    derivation,
    diagnosis,
    drive_train,
    free_motions,
    friction,
    friction_over_campaign,
    measured_and_modelled,
    methods,
    parameters,
    payload,
    sessions,
    torques,
    validation,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.report.reported_run import ForeignRun, IdentifiedRun, ReportedRun
    from hil.report.section import Section

OF_CAMPAIGN: tuple[Callable[[IdentifiedRun], Section | None], ...] = (
    validation.section,
    parameters.section,
    advice.section,
    measured_and_modelled.section,
    payload.section,
    diagnosis.section,
    bodies.section,
    friction_over_campaign.section,
    friction.section,
    torques.section,
    drive_train.section,
    correlations.section,
    methods.section,
    derivation.section,
    sessions.section,
)
"""Of a run whose base parameters are identifiable."""
OF_FRICTION: tuple[Callable[[ReportedRun], Section | None], ...] = (
    friction.section,
    sessions.section,
)
"""Of a run about friction alone."""
OF_FREE_MOTIONS: tuple[Callable[[ForeignRun], Section | None], ...] = (
    validation.section,
    free_motions.section,
    bodies.section,
    payload.section,
    sessions.section,
)
"""Of a run that was imported."""
OF_STROKES: tuple[Callable[[ForeignRun], Section | None], ...] = (
    validation.section,
    back_and_forth.section,
    sessions.section,
)
"""Of a run of axes that move back and forth by themselves, which was imported."""
