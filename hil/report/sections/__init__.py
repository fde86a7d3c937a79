"""Sections of reports and their order; each has a template in this folder.

A section is a function from a run to the section's content, or None without content. A new section
is such a function, a template and a line here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.sections import friction, kept, parameters

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.report.reported_run import ReportedRun
    from hil.show.outcome import Section

OF_IDENTIFIED: tuple[Callable[[ReportedRun], Section | None], ...] = (
    friction.torque,
    kept.validation,
    parameters.parameters,
    parameters.identified,
    parameters.excluded,
    kept.advice,
    parameters.measured_and_modelled,
    kept.load,
    kept.diagnosis,
    kept.bodies,
    friction.friction_over_campaign,
    friction.friction,
    parameters.torques,
    kept.drive_trains,
    parameters.methods,
    kept.sessions,
)
"""Sections for an identified run, by any method."""
OF_FRICTION: tuple[Callable[[ReportedRun], Section | None], ...] = (
    friction.torque,
    friction.friction,
    kept.sessions,
)
"""Sections for a run about friction alone."""
