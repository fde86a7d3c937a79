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


class Readback:
    """Judges by the table what the drive of one axis keeps, and shows it in SI.

    Parameters
    ----------
    axis, drives : AxisDrive, DrivesFile
        What the drives file states.
    requirements : mapping of Entry to Requirement
        Of the bus.
    """

    def __init__(
        self, axis: AxisDrive, drives: DrivesFile, requirements: Mapping[Entry, Requirement]
    ) -> None:
        self._requirements = requirements
        self._drives = drives
        self._measures = measures(axis)

    def accepts(self, entry: Entry, written: int, kept: int) -> bool:
        """Whether a drive serves that keeps `kept` after `written` was written to an object.

        An object that is not in the table must read back exactly.
        """
        need = self._requirement(entry)
        return need is not None and need.kept.accepts(written, kept, self._drives)

    def compared(self, entry: Entry, written: int, kept: int) -> str:
        """Return what is kept and what was written in SI, for what is counted in units."""
        need = self._requirement(entry)
        if need is None or need.quantity is None:
            return ""
        measure = self._measures[need.quantity]
        held, wanted = (f"{measure.value(count):.5g} {measure.unit}" for count in (kept, written))
        return f" ({held} instead of {wanted})"

    def _requirement(self, entry: Entry) -> Requirement | None:
        """Return the row of an object; that of an array's first entry counts for all of it."""
        first = replace(entry, subindex=1)
        return self._requirements.get(entry) or self._requirements.get(first)
