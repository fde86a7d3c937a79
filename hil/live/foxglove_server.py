"""Process for streaming a run to Foxglove: `python -m hil.live.foxglove_server ADDRESS PORT`.

The process reads the run's lines from standard input (`hil.live.lines`) and publishes them as
messages of ROS 2 by Foxglove's own WebSocket server, which buffers some messages per client and
drops the oldest ones for slow clients. Clients can send nothing. The process has a lower priority
than the run, and ends with its input.

/joint_states
    `sensor_msgs/JointState` of each line ``sample``: positions and torques, no velocities.
/diagnostics
    `diagnostic_msgs/DiagnosticArray` with each sample: for each axis the torque, its limit and the
    flags of the sample; for the run the present activity. Levels: warning for a drive at its torque
    limit or a missing sample, error after a fault, stale without power.
/events
    `rcl_interfaces/Log` of events, notes, faults and the end.

Stamps are the computer's clock, as in the lines; the bus's time is a value of the run's diagnosis.
"""

from __future__ import annotations

import json
import sys
import time
from math import nan
from typing import TYPE_CHECKING, Any, NamedTuple

from checked_files.yaml_file import FileError
from drivers.drive_bus import SampleFlag
from hil.export.recordings import ros_messages as ros
from hil.live.listener import begin_listening, url_host
from hil.optional_packages import needed_for

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

TOPICS = {"/joint_states": ros.JOINT_STATE, "/diagnostics": ros.DIAGNOSTICS, "/events": ros.LOG}
"""Topics and message types."""
_STATES = {ros.OK: "under power", ros.STALE: "without power", ros.FAULT: "stopped by a fault"}
_REMARKS = {
    SampleFlag.MISSING: "no sample received",
    SampleFlag.LIMIT: "the drive limits its torque",
}


class Said(NamedTuple):
    """Message with topic and time stamp.

    Attributes
    ----------
    stamp : int
        By the computer's clock [ns].
    data : bytes
        In CDR.
    """

    topic: str
    stamp: int
    data: bytes


class RosLines:
    """Conversion of lines to messages."""

    def __init__(self, messages: ros.RosMessages) -> None:
        self._messages = messages
        self._joints: Sequence[dict[str, Any]] = ()
        self._names: list[str] = []
        self._level, self._doing = ros.STALE, "starting"

    def take(self, line: dict[str, Any]) -> Iterator[Said]:
        """Yield the messages for a line; irrelevant kinds yield none."""
        stamp = round(line["at"] * 1000) * 1_000_000
        if line["kind"] == "start":
            self._joints = line["robot"]["joints"]
            self._names = [f"joint{k}" for k in range(1, len(self._joints) + 1)]
        elif line["kind"] == "sample":
            q, tau = ([nan if x is None else x for x in line[key]] for key in ("q", "tau"))
            state = self._messages.joint_state(stamp, self._names, q, tau)
            yield Said("/joint_states", stamp, state)
            values = {"bus time [s]": f"{line['t']:.4f}", "state": _STATES[self._level]}
            found = [ros.Diagnosis("run", self._level, self._doing, values)]
            each = zip(self._names, self._joints, q, tau, line["flags"], strict=True)
            for name, joint, position, torque, flags in each:
                limit, unit = joint["torque"], joint["torque_unit"]
                values = {
                    f"position [{joint['unit']}]": f"{position:.6g}",
                    f"torque [{unit}]": f"{torque:.6g}",
                }
                if limit is not None:
                    values[f"torque limit [{unit}]"] = f"{limit:g}"
                    values["share of the torque limit [%]"] = f"{100 * abs(torque) / limit:.1f}"
                remarks = [text for flag, text in _REMARKS.items() if flags & flag]
                level = ros.WARNING if remarks and self._level == ros.OK else self._level
                text = "; ".join(remarks) or _STATES[self._level]
                found.append(ros.Diagnosis(f"run: {name}", level, text, values))
            yield Said("/diagnostics", stamp, self._messages.diagnostics(stamp, found))
        elif entry := self._log_entry(line):
            about = line.get("measurement", "run")
            yield Said("/events", stamp, self._messages.log(stamp, entry[0], about, entry[1]))

    def _log_entry(self, line: dict[str, Any]) -> tuple[int, str] | None:
        """Update the state of the run; return level and text for the log, if any."""
        match line["kind"]:
            case "event":
                self._doing = line["doing"]
                return (ros.WARN, line["notice"]) if line["notice"] else (ros.INFO, line["doing"])
            case "armed":
                self._level = ros.OK
                return ros.INFO, f"{len(line['axes'])} axes are under power"
            case "off":
                self._level = ros.FAULT if self._level == ros.FAULT else ros.STALE
                return ros.INFO, "the axes are stopped and without power"
            case "note" | "fault" as kind:
                self._level = ros.FAULT if kind == "fault" else self._level
                return ros.ERROR if kind == "fault" else ros.WARN, line["text"]
            case "end":
                level = ros.ERROR if line["how"] == "failed" else ros.INFO
                return level, ": ".join(filter(None, (line["how"], line["text"])))
        return None


OPTION, EXTRA = "--foxglove", "foxglove"


def main(address: str, port: str) -> None:
    """Serve until the end of standard input."""
    say = begin_listening()
    try:
        messages = ros.RosMessages(OPTION, EXTRA)
        with needed_for(OPTION, EXTRA):
            import foxglove  # noqa: PLC0415 - optional
        channels = {
            topic: foxglove.Channel(
                topic,
                message_encoding="cdr",
                schema=foxglove.Schema(
                    name=kind, encoding="ros2msg", data=messages.definition(kind)
                ),
            )
            for topic, kind in TOPICS.items()
        }
        # at most 256 messages wait for a client, some 3 s of a run
        server = foxglove.start_server(
            name="hil run", host=address, port=int(port), message_backlog_size=256
        )
    except FileError as error:
        say("failed", str(error))
        return
    except (OSError, RuntimeError) as error:
        reason = str(error).removeprefix("FoxgloveError: ")
        failure = f"Foxglove cannot be served on port {port} of {address}: {reason}; choose another"
        say("failed", f"{failure} with {OPTION} PORT, or 0 for a free one")
        return
    say("ready", f"Foxglove: open a connection to ws://{url_host(address)}:{server.port}")
    lines = RosLines(messages)
    for text in sys.stdin.buffer:
        for said in lines.take(json.loads(text)):
            channels[said.topic].log(said.data, log_time=said.stamp)
    time.sleep(0.5)  # time for the clients to get the last messages
    server.stop()


if __name__ == "__main__":
    main(*sys.argv[1:])
