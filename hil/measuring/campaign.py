"""Campaign: a plan carried out on a bus into a run folder, or rehearsed slowly.

The bus is entered and left here, so that the axes stop and power off at any end of the campaign,
and the folder's journal records the reason.

Files are written in parallel to the motion, so that a stalling disk does not stop the robot: the
drives stop half a second after the last heartbeat, and a process waiting for a disk sends none.
Writing tasks go to a worker thread, in order, while the sequencer travels on. Errors of the worker
are raised at the next event. With a full queue, or at the end with the axes off, the campaign waits
for the disk: a measurement is finished only when written.

A rehearsal is the first run on a robot. A measurement needs its own speed, so a slow campaign would
measure nothing useful. A rehearsal passes every path of the plan once, below a share of each axis's
limit: all travels, a stroke there and back of each measurement, and for a coupling the strokes of
both axes in turn. A motion slowed by a factor s has its velocity times s and its acceleration times
s^2, so that several axes follow exactly the path of a motion at full speed. Supervision and trips
are those of a measuring run; the operator's hand is on the stop.

A drive's own limits may be tighter than those used for planning. Then every motion not fixed by the
plan, such as travel between measurements, respects them, and a plan beyond them is refused before
anything moves: a drive that clips a motion spoils the measurement and reports nothing.
"""

from __future__ import annotations

import gc
import logging
import queue
import time
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from threading import Thread
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.drive_bus import LimitExceeded
from hil.measuring import REHEARSAL_SPEED
from hil.measuring.sequencer import (
    Finished,
    Paused,
    Recorded,
    Rehearsed,
    Repeated,
    Started,
    Travelled,
    hold,
    measure,
    never,
    refuse_other_bus,
)
from hil.measuring.travel import locate, pace, pass_along, pass_slowly, travel
from hil.planning.dry_run import measurement_problems
from hil.planning.strokes import TURN
from hil.planning.timetable import SETTLING, travel_time
from hil.runs.journal import BusName, SyncTiming, axis_records
from hil.runs.recording_file import Measured

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence
    from typing import Self

    from drivers.drive_bus import AxisInfo, DriveBus
    from hil.measuring.sequencer import Event
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.planning.strokes import Strokes
    from hil.planning.trapezoid import Trapezoid
    from hil.runs.run_folder import RunFolder


def limited(robot: Robot, axes: Sequence[AxisInfo]) -> Robot:
    """Return `robot` within the limits of its drives, for motions and checks only."""
    if len(axes) != robot.n_joints:
        return robot  # another number of axes is refused at the start of measuring
    joints = tuple(
        joint.model_copy(
            update={
                "q_min": max(joint.q_min, axis.q_min),
                "q_max": min(joint.q_max, axis.q_max),
                "velocity_limit": min(joint.velocity_limit, axis.velocity_max),
                "acceleration_limit": min(joint.acceleration_limit, axis.acceleration_max),
            }
        )
        for joint, axis in zip(robot.file.joints, axes, strict=True)
    )
    if joints == robot.file.joints:
        return robot
    return replace(robot, file=robot.file.model_copy(update={"joints": joints}))


def refuse_beyond(plan: Plan, robot: Robot, axes: Sequence[AxisInfo]) -> None:
    """Check that the plan respects the limits of the drives.

    Parameters
    ----------
    plan : Plan
        Plan to be measured.
    robot : Robot
        Robot of the plan.
    axes : sequence of AxisInfo
        Axes in joint order.

    Raises
    ------
    LimitExceeded
        A line for each problem, with measurement, joint, value and bound.
    """
    problems = measurement_problems(plan, limited(robot, axes))
    if not problems:
        return
    lines = ["the plan exceeds what the drives allow; nothing has moved"]
    lines += [problem.message for problem in problems]
    # the objects of the drives that cause the limits
    for j, axis in enumerate(axes):
        for key, planned, holds in (
            ("q_min", robot.q_min[j], axis.q_min),
            ("q_max", robot.q_max[j], axis.q_max),
            ("velocity", robot.velocity_limit[j], axis.velocity_max),
            ("acceleration", robot.acceleration_limit[j], axis.acceleration_max),
        ):
            # limits of drive and robot file may differ by 0.1 % without being named
            if key in axis.own_limits and abs(holds - planned) > 1e-3 * max(1.0, abs(planned)):
                lines.append(
                    f"joint {j + 1} ({axis.name}): {key} of the drive {holds:.4g} "
                    f"({axis.own_limits[key]}), of the robot file {planned:.4g}; plan within the "
                    "drive's limit, or widen this limit with the maker's tool"
                )
    raise LimitExceeded("\n".join(lines))


log = logging.getLogger(__name__)


def run_campaign(
    folder: RunFolder,
    bus: DriveBus,
    bus_name: BusName = BusName(),  # noqa: B008 - immutable
    pause: Callable[[], bool] = never,
    real_time: Sequence[str] = (),
) -> Generator[Event]:
    """Measure the measurements of `folder` without a recording.

    Parameters
    ----------
    folder : RunFolder
        New folder, or one prepared by `RunFolder.set_aside_damaged`.
    bus : DriveBus
        Bus not entered yet.
    bus_name : BusName
        Name of the bus, for the journal.
    pause : callable
        See `hil.measuring.sequencer.measure`.
    real_time : sequence of str
        Real-time measures granted by the system, for the journal.

    Yields
    ------
    Event
        Events of `hil.measuring.sequencer.measure`.

    Raises
    ------
    DriveError, FileError
        The campaign ended early; finished measurements are kept. `LimitExceeded` is raised before
        any motion if the plan exceeds the limits of the drives.
    """
    missing = {measurement.id for measurement in folder.missing}
    done = [m.id for m in folder.plan.measurements if m.id not in missing]
    with _session(folder, bus, bus_name, real_time) as (session, background), bus:
        robot = _note_axes(folder, bus, background)
        timing = SyncTiming()
        for event in measure(folder.plan, robot, bus, done, pause):
            if isinstance(event, Recorded):
                measured = Measured(
                    event.measurement, event.recording, event.attempts, event.findings, session
                )
                timing = timing.add_recording(event.recording)
                folder.keep(sync=timing)
                background.do(partial(_save, folder, measured))
            elif isinstance(event, Repeated):
                messages = [finding.message for finding in event.findings]
                folder.keep_repeated(event.measurement.id, event.attempt, messages)
                background.do(folder.save_journal)
            background.check()
            yield event


def _save(folder: RunFolder, measured: Measured) -> None:
    """Write a recording, then the journal; a kill in between keeps the recording."""
    folder.write(measured)
    folder.save_journal()


def rehearse_campaign(
    folder: RunFolder,
    bus: DriveBus,
    bus_name: BusName,
    speed: float,
    pause: Callable[[], bool] = never,
    real_time: Sequence[str] = (),
) -> Generator[Event]:
    """Rehearse the motions of the folder's plan at `speed`, and note the rehearsal in the folder.

    Parameters, events and errors are those of `run_campaign` and `hil.measuring.campaign`.
    """
    with _session(folder, bus, bus_name, real_time) as (_, background), bus:
        robot = _note_axes(folder, bus, background)
        yield from rehearse(folder.plan, robot, bus, speed, pause)
    folder.note_rehearsed(speed)


@contextmanager
def _session(
    folder: RunFolder, bus: DriveBus, bus_name: BusName, real_time: Sequence[str]
) -> Iterator[tuple[int, Background]]:
    """Open a session of the folder and a worker that writes into the folder.

    Objects loaded so far are excluded from garbage collection, which lasts many SYNCs. The session
    receives all notes of the bus, including those made on leaving the bus.
    """
    with folder.session(bus_name, real_time) as session, ExitStack() as left:
        left.callback(lambda: folder.keep(notes=tuple(bus.notes)))
        gc.collect()
        gc.freeze()
        left.callback(gc.unfreeze)
        yield session, left.enter_context(Background())


def _note_axes(folder: RunFolder, bus: DriveBus, background: Background) -> Robot:
    """Note the drives in the journal; return the robot within the limits of the drives."""
    folder.refuse_other_drives(bus.axes)
    folder.keep(axes=axis_records(bus.axes))
    background.do(folder.save_journal)
    refuse_beyond(folder.plan, folder.robot, bus.axes)
    return limited(folder.robot, bus.axes)


class Background:
    """Worker thread that carries out tasks in order; leaving waits for all tasks.

    Parameters
    ----------
    waiting_max : int
        Maximum number of queued tasks: recordings of a minute or two of measuring.
    patience : float
        Time that `do` waits for a free place before the campaign is given up [s].
    """

    def __init__(self, waiting_max: int = 8, patience: float = 30.0) -> None:
        # Other queues have locks that an interrupt can leave locked for good.
        self._tasks: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._waiting_max = waiting_max
        self._patience = patience
        self._failed: list[Exception] = []
        self._worker = Thread(target=self._work, name="run folder", daemon=True)

    def __enter__(self) -> Self:
        """Start the thread."""
        self._worker.start()
        return self

    def __exit__(self, *raised: object) -> None:
        """Wait until the files are written.

        Raises
        ------
        FileError
            A file could not be written; while another exception is handled, this error is logged
            instead.
        """
        self._tasks.put(None)
        self._worker.join()
        is_left_by_error = raised[0] is not None
        for error in self._failed[0 if is_left_by_error else 1 :]:
            log.error("%s", error)
        if not is_left_by_error:
            self.check()

    def do(self, task: Callable[[], None]) -> None:
        """Queue `task` for the worker.

        Raises
        ------
        FileError
            The disk accepts no data.
        """
        ends = time.monotonic() + self._patience
        while self._tasks.qsize() >= self._waiting_max:
            if time.monotonic() > ends:
                raise FileError(
                    f"no file was written to disk for {self._patience:g} s, with "
                    f"{self._waiting_max} waiting; check the disk, then continue with --resume"
                )
            # polls for a free place every 5 ms
            time.sleep(0.005)
        self._tasks.put(task)

    def check(self) -> None:
        """Raise the first error of the worker since the last call.

        Raises
        ------
        FileError
            A file could not be written.
        """
        if self._failed:
            raise self._failed.pop(0)

    def _work(self) -> None:
        while (task := self._tasks.get()) is not None:
            try:
                task()
            except Exception as error:  # raised again by `check`, in the caller's thread
                self._failed.append(error)


def rehearse(
    plan: Plan,
    robot: Robot,
    bus: DriveBus,
    speed: float = REHEARSAL_SPEED,
    pause: Callable[[], bool] = never,
) -> Iterator[Event]:
    """Rehearse the motions of `plan`.

    Parameters
    ----------
    bus : DriveBus
        Bus entered and left by the caller.
    speed : float
        Largest share of each axis's velocity limit in any motion.
    pause : callable
        As in `hil.measuring.sequencer.measure`.

    Yields
    ------
    Event
        Started, Travelled, Rehearsed, Paused and Finished.

    Raises
    ------
    DriveError
        Errors as in a measurement at full speed.
    """
    refuse_other_bus(plan, robot, bus)
    here = locate(bus)
    slow, number = min(1.0, speed / plan.travel), len(plan.measurements)
    # expected durations of the measurements, with the travel to each [s]
    left, place = [], here.q
    for measurement in plan.measurements:
        way = travel_time(robot, place, measurement.start, plan.travel) / slow + SETTLING
        if measurement.streamed:
            motion = measurement.period / pace(measurement, robot, speed)
        else:
            strokes = [profile.duration for _, profile in _slowed(measurement, robot, speed)]
            motion = sum(strokes) + TURN * len(strokes)
        left.append(way + motion)
        place = measurement.start
    yield Started(here.time, sum(left), number, number)
    for measurement in plan.measurements:
        now = travel(bus, robot, measurement.start, plan.travel, plan.workspace, slow)
        yield Travelled(now.time, sum(left), measurement)
        if measurement.streamed:
            now = pass_slowly(bus, measurement, pace(measurement, robot, speed))
        else:
            for index, profile in _slowed(measurement, robot, speed):
                now = pass_along(bus, index, profile, measurement.id)
        left.pop(0)
        yield Rehearsed(now.time, sum(left), measurement)
        if pause():
            yield Paused(now.time, sum(left))
            hold(bus, pause)
    yield Finished(locate(bus).time, 0.0, number, ())


def _slowed(measurement: Strokes, robot: Robot, speed: float) -> Iterator[tuple[int, Trapezoid]]:
    """Yield strokes there and back of single axes, no faster than `speed` allows."""
    ways = [(measurement.index, measurement.profile(k)) for k in (0, 1)]
    for partner in measurement.partners:
        ways[1:1] = [(partner.index, partner.profile(measurement.q, k)) for k in (0, 1)]
    for index, profile in ways:
        slow = min(1.0, speed * float(robot.velocity_limit[index]) / profile.velocity)
        yield (
            index,
            replace(
                profile,
                velocity=slow * profile.velocity,
                acceleration=slow**2 * profile.acceleration,
            ),
        )
