"""The sections of reports and their order; each has a template in this folder.

A section is one function, from a run to what the section shows or to None where there is nothing to
show. A new one is a function beside those about the same thing, its template and a line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.sections import elements, friction, imported, kept, of_run, parameters

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.report.reported_run import ForeignRun, IdentifiedRun, ReportedRun
    from hil.report.section import Section

OF_CAMPAIGN: tuple[Callable[[IdentifiedRun], Section | None], ...] = (
    kept.validation,
    parameters.parameters,
    of_run.advice,
    elements.measured_and_modelled,
    kept.load,
    kept.diagnosis,
    kept.bodies,
    friction.friction_over_campaign,
    friction.friction,
    elements.torques,
    of_run.drive_trains,
    parameters.correlations,
    parameters.methods,
    of_run.derivation,
    of_run.sessions,
)
"""Of a run whose base parameters are identifiable."""
OF_FRICTION: tuple[Callable[[ReportedRun], Section | None], ...] = (
    friction.friction,
    of_run.sessions,
)
"""Of a run about friction alone."""
OF_FREE_MOTIONS: tuple[Callable[[ForeignRun], Section | None], ...] = (
    kept.validation,
    imported.free_motions,
    kept.bodies,
    kept.load,
    of_run.sessions,
)
"""Of a run that was imported."""
OF_STROKES: tuple[Callable[[ForeignRun], Section | None], ...] = (
    kept.validation,
    imported.back_and_forth,
    of_run.sessions,
)
"""Of a run of axes that move back and forth by themselves, which was imported."""
