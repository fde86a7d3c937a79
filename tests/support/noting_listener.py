"""Listener process of a run that writes all lines to a file, started by `hil.live.listener`.

Arguments: the file to write, and its behaviour: ``note``; ``deaf`` (reads nothing until the end);
``refuse`` (cannot serve); ``stop`` (wants a stop at the first recording); ``leave`` (ends at it);
``late`` (wants a stop when all is over).
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path


def say(kind: str, text: str = "") -> None:
    sys.stdout.write(json.dumps({"kind": kind, "text": text}) + "\n")
    sys.stdout.flush()


def main(path: str, manner: str) -> None:
    if manner == "refuse":
        say("failed", "port 8765 is taken; choose another")
        return
    say("ready", "noting")
    if manner == "deaf":
        time.sleep(60)
    with Path(path).open("w") as file:
        for line in sys.stdin:
            file.write(line)
            if '"name":"Recorded"' in line and manner == "stop":
                say("stop")
            elif '"name":"Recorded"' in line and manner == "leave":
                return
    if manner == "late":
        say("stop")


if __name__ == "__main__":
    main(*sys.argv[1:])
