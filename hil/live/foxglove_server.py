"""The process that streams a run to Foxglove: `python -m hil.live.foxglove_server ADDRESS PORT`.

It reads the run's lines from its standard input (`hil.live.lines`) and passes them on as messages
of ROS 2 (`ros_lines`) over Foxglove's own WebSocket server, which keeps `BACKLOG` messages a client
and leaves the oldest out for one that does not read. Clients may only look: the server offers them
no way to send anything. It has a lower priority than the run, and ends with its input.
"""

from __future__ import annotations

import json
import os
import sys
import time
from typing import Any

from checked_files.yaml_file import FileError
from hil.export.recordings.ros_messages import RosMessages
from hil.live.ros_lines import TOPICS, RosLines
from hil.optional_packages import needed_for

OPTION, EXTRA = "--foxglove", "foxglove"
NICE = 10
"""By how much the run goes first."""
BACKLOG = 256
"""Messages that wait for one client; some 3 s of a run."""
LAST_WORDS = 0.5
"""How long clients may take to get the last messages [s]."""


def main(address: str, port: str) -> None:
    """Serve until the end of standard input."""
    os.nice(NICE)
    try:
        messages = RosMessages(OPTION, EXTRA)
        server, channels = _served(messages, address, int(port))
    except FileError as error:
        _say("failed", str(error))
        return
    except (OSError, RuntimeError) as error:
        _say(
            "failed",
            f"Foxglove cannot be served on port {port} of {address}: {_reason(error)}; choose"
            f" another with {OPTION} PORT, or 0 for a free one",
        )
        return
    host = f"[{address}]" if ":" in address else address
    _say("ready", f"Foxglove: open a connection to ws://{host}:{server.port}")
    lines = RosLines(messages)
    for text in sys.stdin.buffer:
        for said in lines.take(json.loads(text)):
            channels[said.topic].log(said.data, log_time=said.stamp)
    time.sleep(LAST_WORDS)
    server.stop()


def _served(messages: RosMessages, address: str, port: int) -> tuple[Any, dict[str, Any]]:
    """Start the server; return it and its channels by topic."""
    with needed_for(OPTION, EXTRA):
        import foxglove  # noqa: PLC0415 - optional
    channels = {
        topic: foxglove.Channel(
            topic,
            message_encoding="cdr",
            schema=foxglove.Schema(name=kind, encoding="ros2msg", data=messages.definition(kind)),
        )
        for topic, kind in TOPICS.items()
    }
    server = foxglove.start_server(
        name="hil run", host=address, port=port, message_backlog_size=BACKLOG
    )
    return server, channels


def _reason(error: Exception) -> str:
    return str(error).removeprefix("FoxgloveError: ")


def _say(kind: str, text: str) -> None:
    sys.stdout.write(json.dumps({"kind": kind, "text": text}) + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
