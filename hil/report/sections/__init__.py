"""The sections of reports and their order; each has a template in this folder.

A section is one function, from a run to what the section shows or to None where there is nothing to
show. A new one is a function beside those about the same thing, its template and a line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.sections import (
    elements,
    excluded,
    friction,
    imported,
    kept,
    of_run,
    parameters,
    torques,
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.report.reported_run import ReportedRun
    from hil.show.section import Section

OF_IDENTIFIED: tuple[Callable[[ReportedRun], Section | None], ...] = (
    torques.torque,
    kept.validation,
    parameters.parameters,
    imported.identified,
    excluded.excluded,
    of_run.advice,
    elements.measured_and_modelled,
    kept.load,
    kept.diagnosis,
    kept.bodies,
    friction.friction_over_campaign,
    friction.friction,
    elements.torques,
    of_run.drive_trains,
    parameters.methods,
    of_run.sessions,
)
"""Of a run that was identified, by whatever method: each shows what there is of its subject."""
OF_FRICTION: tuple[Callable[[ReportedRun], Section | None], ...] = (
    torques.torque,
    friction.friction,
    of_run.sessions,
)
"""Of a run about friction alone."""
