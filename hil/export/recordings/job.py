"""What a writer of recordings is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hil.runs.recording_file import Measured
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A run and where it goes.

    Attributes
    ----------
    run : Run
    folder : Path
        Empty; everything is written into it.
    joints : tuple of str
        Names of the joints, in order.
    progress : callable
        Takes the id of each measurement before it is written.
    """

    run: Run
    folder: Path
    joints: tuple[str, ...]
    progress: Callable[[str], None]

    def __iter__(self) -> Iterator[Measured]:
        """Read the run's measurements, stating each."""
        for measured in self.run:
            self.progress(measured.measurement.id)
            yield measured


Writer = Callable[[Job], None]
"""Writes the recordings of a run in one format."""
