"""Pooling of several runs of a robot as one campaign.

Friction is fitted for each measurement, so runs of different days can be identified together;
properties common to all measurements of an axis (offset, ripple over the motor angle, lag of the
current) must have stayed constant. Time continues from run to run, `APART` later: each run starts
with rested gears.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hil.errors import Mismatch
from hil.runs.run import Run

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording
    from hil.runs.recording_file import Measured


APART = 86400.0
"""Time between runs [s]."""


def recorded(campaign: Iterable[Measured]) -> Iterator[tuple[RecordedMotion, Recording]]:
    """Yield the recordings of a run folder, with time continued across sessions."""
    session, offset, last = 0, 0.0, 0.0
    for measured in campaign:
        if measured.session != session:
            session, offset = measured.session, last
        recording = measured.recording
        shifted = replace(recording, time=recording.time + offset)
        last = max(last, float(shifted.time[-1]))
        yield measured.measurement, shifted


def open_runs(paths: Sequence[Path | str]) -> list[Run]:
    """Open run folders of a robot.

    Raises
    ------
    FileError
        A folder is not a run.
    Mismatch
        A run is of another robot, or named twice.
    """
    folders = [Run.open(path) for path in paths]
    refuse_mixed(folders)
    return folders


def refuse_mixed(folders: Sequence[Run]) -> None:
    """Refuse runs of different robots, or repeated runs.

    Raises
    ------
    Mismatch
        A run is of another robot, or named twice.
    """
    for number, folder in enumerate(folders):
        first = folders[0]
        if folder.robot.digest != first.robot.digest:
            raise Mismatch(
                f"{folder.path}: was measured with another robot file than {first.path}"
                f" ({folder.robot.name} {folder.robot.digest[:12]}, {first.robot.name}"
                f" {first.robot.digest[:12]}); only runs of one robot can be identified together"
            )
        if folder.path.resolve() in [other.path.resolve() for other in folders[:number]]:
            raise Mismatch(f"{folder.path}: is named twice; name each run once")


def pooled(folders: Sequence[Run]) -> Iterator[tuple[RecordedMotion, Recording]]:
    """Yield the recordings of all runs; repeated ids get the number of the run.

    Raises
    ------
    Mismatch
        See `refuse_mixed`.
    """
    refuse_mixed(folders)
    taken: set[str] = set()
    offset = last = 0.0
    for number, folder in enumerate(folders, start=1):
        own: set[str] = set()
        for measurement, recording in recorded(folder):
            name = measurement.id if measurement.id not in taken else f"{measurement.id}.{number}"
            own.add(name)
            shifted = replace(recording, time=recording.time + offset)
            last = max(last, float(shifted.time[-1]))
            yield measurement.model_copy(update={"id": name}), shifted
        taken |= own
        offset = last + APART


class Pooled:
    """Recordings of all runs, read anew in every iteration; see `pooled`."""

    def __init__(self, folders: Sequence[Run]) -> None:
        self._folders = folders

    def __iter__(self) -> Iterator[tuple[RecordedMotion, Recording]]:
        return pooled(self._folders)
