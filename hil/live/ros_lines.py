"""The lines of a run as messages of ROS 2, which Foxglove shows while the robot moves.

/joint_states
    `sensor_msgs/JointState` of each line ``sample``: positions and torques, no velocities.
/diagnostics
    `diagnostic_msgs/DiagnosticArray` with each sample: of each axis its torque beside its limit and
    what the sample's flags say, and of the run what is being done. Levels: a warning where a drive
    reports that it limits its torque, or no sample came; an error after a fault; stale without
    power.
/events
    `rcl_interfaces/Log` of events, notes, faults and the end.

Stamps are the computer's clock, as in the lines; the bus's time is a value of the run's diagnosis.
"""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

from drivers.drive_bus import SampleFlag
from hil.export.recordings.ros_messages import (
    DIAGNOSTICS,
    ERROR,
    FAULT,
    INFO,
    JOINT_STATE,
    LOG,
    OK,
    STALE,
    WARN,
    WARNING,
    Diagnosis,
    RosMessages,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

TOPICS = {"/joint_states": JOINT_STATE, "/diagnostics": DIAGNOSTICS, "/events": LOG}
"""Topics and the types of their messages."""
_MILLISECOND = 1_000_000
_STATES = {OK: "under power", STALE: "without power", FAULT: "stopped by a fault"}
_REMARKS = {
    SampleFlag.MISSING: "no sample came",
    SampleFlag.LIMIT: "the drive limits its torque",
}


class Said(NamedTuple):
    """A message and where it goes.

    Attributes
    ----------
    topic : str
    stamp : int
        By the computer's clock [ns].
    data : bytes
        In CDR.
    """

    topic: str
    stamp: int
    data: bytes


class RosLines:
    """Turns one line after the other into messages."""

    def __init__(self, messages: RosMessages) -> None:
        self._messages = messages
        self._joints: Sequence[dict[str, Any]] = ()
        self._names: list[str] = []
        self._level, self._doing = STALE, "starting"

    def take(self, line: dict[str, Any]) -> Iterator[Said]:
        """Yield what a line says; lines of kinds that nobody shows say nothing."""
        stamp = round(line["at"] * 1000) * _MILLISECOND
        if line["kind"] == "start":
            self._joints = line["robot"]["joints"]
            self._names = [f"joint{k}" for k in range(1, len(self._joints) + 1)]
        elif line["kind"] == "sample":
            yield from self._sample(line, stamp)
        else:
            self._note(line)
            for level, text in _told(line):
                about = line.get("measurement", "run")
                yield Said("/events", stamp, self._messages.log(stamp, level, about, text))

    def _note(self, line: dict[str, Any]) -> None:
        """Take in what changes the state of the run."""
        match line["kind"]:
            case "armed":
                self._level = OK
            case "off" if self._level != FAULT:
                self._level = STALE
            case "fault":
                self._level = FAULT
            case "event":
                self._doing = line["doing"]

    def _sample(self, line: dict[str, Any], stamp: int) -> Iterator[Said]:
        q, tau = ([nan if x is None else x for x in line[key]] for key in ("q", "tau"))
        state = self._messages.joint_state(stamp, self._names, q, tau)
        yield Said("/joint_states", stamp, state)
        values = {"bus time [s]": f"{line['t']:.4f}", "state": _STATES[self._level]}
        run = Diagnosis("run", self._level, self._doing, values)
        axes = [
            self._axis(*each)
            for each in zip(range(len(q)), self._joints, q, tau, line["flags"], strict=True)
        ]
        yield Said("/diagnostics", stamp, self._messages.diagnostics(stamp, [run, *axes]))

    def _axis(
        self, axis: int, joint: dict[str, Any], q: float, tau: float, flags: int
    ) -> Diagnosis:
        limit = joint["torque"]
        values = {
            f"position [{joint['unit']}]": f"{q:.6g}",
            f"torque [{joint['torque_unit']}]": f"{tau:.6g}",
        }
        if limit is not None:
            values[f"torque limit [{joint['torque_unit']}]"] = f"{limit:g}"
            values["share of the torque limit [%]"] = f"{100 * abs(tau) / limit:.1f}"
        remarks = [text for flag, text in _REMARKS.items() if flags & flag]
        level = WARNING if remarks and self._level == OK else self._level
        text = "; ".join(remarks) or _STATES[self._level]
        return Diagnosis(f"run: {self._names[axis]}", level, text, values)


def _told(line: dict[str, Any]) -> Iterator[tuple[int, str]]:
    """Level and text of a line for the log."""
    match line["kind"]:
        case "event":
            yield (WARN, line["notice"]) if line["notice"] else (INFO, line["doing"])
        case "armed":
            yield INFO, f"{len(line['axes'])} axes are under power"
        case "off":
            yield INFO, "the axes are stopped and without power"
        case "note":
            yield WARN, line["text"]
        case "fault":
            yield ERROR, line["text"]
        case "end":
            level = ERROR if line["how"] == "failed" else INFO
            yield level, ": ".join(filter(None, (line["how"], line["text"])))
