"""What lies between the currents and the arm: late readings, soft gears, friction of the load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.section import Section
from hil.results.tables.drive_train import drive_train

if TYPE_CHECKING:
    from hil.report.reported_run import IdentifiedRun


def section(run: IdentifiedRun) -> Section | None:
    """Drive train of each axis; None where nothing of it was estimated."""
    axes = drive_train(run.estimate, run.robot)
    if not axes:
        return None
    return Section("Drive trains", "drive_train.html", {"axes": axes})
