"""Recordings as one MCAP file with messages of ROS 2, for Foxglove, PlotJuggler and rosbag2.

`TOPICS` lists the topics. A time stamp is the computer's clock at the start of the session plus the
time of the bus: it is exact to 1 ns within a session, and to seconds between sessions. A simulation
in lock-step may last longer in robot time than on the computer's clock; the following session is
then delayed. The date of imported recordings is unknown: their stamps begin at 0.
"""

from __future__ import annotations

from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from checked_files.yaml_file import FileError
from hil.export.recordings.ros_messages import INFO, JOINT_STATE, LOG, SECOND, WARN, RosMessages
from hil.export.recordings.tables import README, facts, readme
from hil.imports.readers.joint_state_layout import layout_of
from hil.optional_packages import needed_for
from hil.runs.atomic_file import new_file
from hil.runs.set_points import set_points

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.export.recordings.tables import Job
    from hil.runs.run import Run

    Stamps = NDArray[np.int64]

ROWS = 1 << 14
"""Number of messages created together."""
TOPICS = {"/joint_states": JOINT_STATE, "/set_points": JOINT_STATE, "/events": LOG}
"""Topics and the types of their messages."""
ABOUT = (
    "/joint_states: sensor_msgs/JointState at every sample, recorded; torques as effort, no"
    " velocities where none were recorded",
    "/set_points: sensor_msgs/JointState with positions only, derived, for planned motions",
    "/events: rcl_interfaces/Log on measurements, findings, repeated attempts and notes",
    "Stamps: the computer's clock when a session began plus the bus's time; imported recordings "
    "begin at 0.",
)


def write_mcap(job: Job) -> None:
    """Write the recordings of a run as ``RUN.mcap``, and a readme file.

    Raises
    ------
    FileError
        mcap or rosbags is not installed.
    """
    with needed_for("--to mcap"):
        from mcap.writer import Writer  # noqa: PLC0415 - optional
    messages = RosMessages("--to mcap", "recordings")
    with new_file(job.folder / f"{job.run.path.resolve().name}.mcap") as file:
        writer = Writer(file)
        writer.start("ros2", library="hil")
        writer.add_metadata("run", facts(job))
        _Content(job, messages, writer).write()
        writer.finish()  # type: ignore[no-untyped-call]
    with new_file(job.folder / README) as file:
        file.write(readme(job, ABOUT).encode())


class _Content:
    """Messages of the measurements, written in order of time."""

    def __init__(self, job: Job, messages: RosMessages, writer: Any) -> None:
        self._job, self._messages, self._writer = job, messages, writer
        kinds = {
            kind: writer.register_schema(kind, "ros2msg", messages.definition(kind))
            for kind in dict.fromkeys(TOPICS.values())
        }
        self._channels = {
            topic: writer.register_channel(topic, "cdr", kinds[kind])
            for topic, kind in TOPICS.items()
        }
        self._noted: set[int] = set()

    def write(self) -> None:
        run = self._job.run
        for name, begin in _timeline(run):
            self._job.progress(name)
            measured = run[name]
            recording, session = measured.recording, run.journal.sessions[measured.session]
            stamps = begin + np.rint(recording.time * SECOND).astype(np.int64)
            notes = []
            if measured.session not in self._noted:
                self._noted.add(measured.session)
                notes += [(INFO, note) for note in session.notes]
            for failed in session.repeated:
                if failed.measurement == name:
                    reasons = "; ".join(failed.findings)
                    notes.append((WARN, f"attempt {failed.attempt} was repeated: {reasons}"))
            motion = measured.measurement
            notes.append((INFO, f"{motion.kind}, {motion.axes_in_words}"))
            for level, text in notes:
                self._event(int(stamps[0]), level, name, text)
            parts = {"position": recording.q, "effort": recording.tau}
            if recording.qd is not None:
                parts["velocity"] = recording.qd
            planned = set_points(motion, recording)
            for first in range(0, len(stamps), ROWS):
                some = slice(first, first + ROWS)
                joints = self._states(stamps[some], {k: v[some] for k, v in parts.items()})
                topics = {"/joint_states": joints}
                if planned is not None:
                    topics["/set_points"] = self._states(stamps[some], {"position": planned[some]})
                for stamp, *data in zip(stamps[some].tolist(), *topics.values(), strict=True):
                    for topic, message in zip(topics, data, strict=True):
                        self._add(topic, stamp, message)
            for finding in measured.findings:
                self._event(int(stamps[-1]), WARN, name, finding.message)

    def _states(self, stamps: Stamps, parts: dict[str, Array]) -> Iterator[bytes]:
        """Return joint states; only stamp and values differ between messages."""
        empty = {part: np.zeros(values.shape[1]) for part, values in parts.items()}
        like = self._messages.joint_state(0, self._job.joints, **empty)
        found = layout_of(like).messages(like, stamps // SECOND, stamps % SECOND, parts)
        return (each.tobytes() for each in found)

    def _event(self, stamp: int, level: int, name: str, text: str) -> None:
        self._add("/events", stamp, self._messages.log(stamp, level, name, text))

    def _add(self, topic: str, stamp: int, data: bytes) -> None:
        channel = self._channels[topic]
        self._writer.add_message(channel, log_time=stamp, publish_time=stamp, data=data)


def _timeline(run: Run) -> Iterator[tuple[str, int]]:
    """Yield id and time 0 on the clock [ns] of measurements, without overlap."""
    spans = sorted(
        (each.session, float(time[0]), float(time[-1]), each.measurement.id)
        for each, time in ((each, each.recording.time) for each in run)
    )
    last, begin, end = -1, 0, -SECOND  # recordings that would overlap are placed a second apart
    for session, first, until, name in spans:
        if session != last or begin + round(first * SECOND) <= end:
            last = session
            began = 0  # imported recordings have no date
            if not run.imported:
                stated = run.journal.sessions[session].started
                try:
                    began = round(datetime.fromisoformat(stated).timestamp()) * SECOND
                except ValueError as error:
                    raise FileError(
                        f"{run.path / 'run.json'}: {stated!r} is not a start time of a session; "
                        "restore the run's own file"
                    ) from error
            begin = max(began, end + SECOND - round(first * SECOND))
        end = begin + round(until * SECOND)
        yield name, begin
