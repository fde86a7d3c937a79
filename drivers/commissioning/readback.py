"""What a drive keeps of a value that was written, judged by the table of requirements."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from drivers.commissioning.measures import measures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from drivers.commissioning.requirement import Requirement
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from drivers.remote_dictionary import Judge


def readback(
    axis: AxisDrive, drives: DrivesFile, requirements: Mapping[Entry, Requirement]
) -> Judge:
    """Return what judges by the table what the drive of one axis keeps, and shows it in SI.

    An object that is not in the table must read back exactly.

    Parameters
    ----------
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    requirements : mapping of Entry to Requirement
        Of the bus.
    """
    counted = measures(axis)

    def judge(entry: Entry, written: int, kept: int) -> tuple[bool, str]:
        # The row of an array's first entry counts for all of it.
        need = requirements.get(entry) or requirements.get(replace(entry, subindex=1))
        if need is None:
            return False, ""
        accepted = need.kept.accepts(written, kept, drives)
        if need.quantity is None:
            return accepted, ""
        measure = counted[need.quantity]
        held, wanted = (f"{measure.value(count):.5g} {measure.unit}" for count in (kept, written))
        return accepted, f" ({held} instead of {wanted})"

    return judge
