"""Process for identification during a run: `python -m hil.live.estimator FOLDER`.

The process reads the run's lines from standard input (`hil.live.lines`), and each announced
recording from the run's folder, so that the process that moves the robot never waits. It writes
lines ``torque`` and ``estimate`` to standard output. If it is too slow, several recordings are
combined to one estimate. It has the lowest priority, and ends with its input.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from typing import TYPE_CHECKING

from hil.live.listener import begin_listening

if TYPE_CHECKING:
    from collections.abc import Iterator

PATIENCE = 30.0
"""Maximum wait for a recording, equal to the run's wait for a disk [s]."""


def main(folder: str) -> None:
    """Estimate until the end of standard input."""
    say = begin_listening()
    os.nice(9)
    say("ready", "")
    recorded: SimpleQueue[str | None] = SimpleQueue()
    Thread(target=_listen, args=(recorded,), daemon=True).start()
    first = recorded.get()
    if first is None:
        return
    # numerics are imported only now, when a run is certain
    from hil.live.interim import Interim  # noqa: PLC0415
    from hil.runs.run import Run  # noqa: PLC0415

    run = Run.open(Path(folder))
    if not run.robot.limits_known:
        return
    interim = Interim(run.robot)
    motions = {each.id: each for each in run.motions}
    not_yet = {first, *(each.id for each in run.missing)}
    before = [name for name in motions if name not in not_yet]
    for names in _batches([*before, first], recorded):
        for name in filter(motions.__contains__, names):
            path = run.recording_path(motions[name])
            # a file is written whole, then renamed
            ends = time.monotonic() + PATIENCE
            while not path.exists() and time.monotonic() < ends:
                time.sleep(0.02)
            if path.exists():
                for line in interim.take(motions[name], run.read(motions[name]).recording):
                    if name in not_yet:  # times of earlier sessions are on another clock
                        say("torque", **line)
        say("estimate", **interim.parameters())


def _listen(recorded: SimpleQueue[str | None]) -> None:
    for text in sys.stdin.buffer:
        if b'"Recorded"' in text:
            line = json.loads(text)
            if line.get("name") == "Recorded":
                recorded.put(line["measurement"])
    recorded.put(None)


def _batches(first: list[str], recorded: SimpleQueue[str | None]) -> Iterator[list[str]]:
    """Yield batches of new names since the last batch, until the end."""
    seen = set(first)
    yield first
    while True:
        names = [recorded.get()]
        while not recorded.empty():
            names.append(recorded.get())
        fresh = [name for name in names if name is not None and name not in seen]
        seen |= set(fresh)
        if fresh:
            yield fresh
        if None in names:
            return


if __name__ == "__main__":
    main(*sys.argv[1:])
