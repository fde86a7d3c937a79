"""A plan carried out on a bus into a run folder: the sequencer with its surroundings.

The bus is entered and left here, so that the axes stop and power off however the campaign ends,
and the folder's journal says how. Files are written in the background while the axes are on; the
campaign is finished when all of them are on the disk.
"""

from __future__ import annotations

import gc
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from hil.measuring.background import Background
from hil.measuring.checks.axis_limits import limited, refuse_beyond
from hil.measuring.events import Recorded, Repeated
from hil.measuring.rehearsal import rehearse
from hil.measuring.sequencer import measure, never
from hil.runs.journal import BusName
from hil.runs.recording_file import Measured
from hil.runs.sync_timing import SyncTiming

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    from drivers.drive_bus import DriveBus
    from hil.measuring.events import Event
    from hil.model.robot import Robot
    from hil.runs.run_folder import RunFolder


def run_campaign(
    folder: RunFolder,
    bus: DriveBus,
    bus_name: BusName = BusName(),  # noqa: B008 - immutable
    pause: Callable[[], bool] = never,
    real_time: Sequence[str] = (),
) -> Generator[Event]:
    """Measure what `folder` has no recording of.

    Parameters
    ----------
    folder : RunFolder
        A new one, or one prepared by `RunFolder.set_aside_damaged`.
    bus : DriveBus
        Not entered yet.
    bus_name : BusName
        What the bus is, for the journal.
    pause : callable
        See `hil.measuring.sequencer.measure`.
    real_time : sequence of str
        What the system granted of real time, for the journal.

    Yields
    ------
    Event
        Those of `hil.measuring.sequencer.measure`.

    Raises
    ------
    DriveError, FileError
        The campaign ended early; what was measured stays. `LimitExceeded` before anything moved
        where the plan exceeds the limits that hold on the drives.
    """
    missing = {measurement.id for measurement in folder.missing}
    done = [m.id for m in folder.plan.measurements if m.id not in missing]
    with (
        folder.session(bus_name, real_time) as session,
        _notes_kept(folder, bus),
        _collector_spared(),
        Background() as background,
        bus,
    ):
        robot = _note_axes(folder, bus, background)
        timing = SyncTiming()
        for event in measure(folder.plan, robot, bus, done, pause):
            if isinstance(event, Recorded):
                measured = Measured(
                    event.measurement, event.recording, event.attempts, event.findings, session
                )
                background.do(partial(folder.write, measured))
                timing = timing.with_recording(event.recording)
                folder.keep_timing(timing)
            elif isinstance(event, Repeated):
                messages = [finding.message for finding in event.findings]
                folder.keep_repeated(event.measurement.id, event.attempt, messages)
            background.check()
            yield event


def rehearse_campaign(
    folder: RunFolder,
    bus: DriveBus,
    bus_name: BusName,
    speed: float,
    pause: Callable[[], bool] = never,
    real_time: Sequence[str] = (),
) -> Generator[Event]:
    """Pass all ways of the folder's plan at `speed`, and note in the folder that it was done.

    Parameters, events and errors are those of `run_campaign` and `hil.measuring.rehearsal`.
    """
    with (
        folder.session(bus_name, real_time),
        _notes_kept(folder, bus),
        _collector_spared(),
        Background() as background,
        bus,
    ):
        robot = _note_axes(folder, bus, background)
        yield from rehearse(folder.plan, robot, bus, speed, pause)
    folder.note_rehearsed(speed)


def _note_axes(folder: RunFolder, bus: DriveBus, background: Background) -> Robot:
    """Take what the drives are; return the robot within the limits that hold on them."""
    folder.refuse_other_drives(bus.axes)
    folder.keep_axes(bus.axes)
    background.do(folder.save_journal)
    refuse_beyond(folder.plan, folder.robot, bus.axes)
    return limited(folder.robot, bus.axes)


@contextmanager
def _notes_kept(folder: RunFolder, bus: DriveBus) -> Iterator[None]:
    """Give the session what the bus has noted, also while it was left."""
    try:
        yield
    finally:
        folder.keep_notes(bus.notes)


@contextmanager
def _collector_spared() -> Iterator[None]:
    """Keep what is loaded by now out of the garbage collector's rounds, which last many SYNCs."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
