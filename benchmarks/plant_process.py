"""The virtual plant as a separate process on the wall clock, in real time; processes as load."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from hil.cli.realtime import PRIORITY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def plant(
    interface: str, channel: str, warm_up: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Serve the plant; `warm_up` runs before the switch to the real-time class."""
    place = ("--interface", interface, "--channel", channel)
    command = (sys.executable, "-m", "sim_plant", *place, "--clock", "wall")
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline(), "the plant did not start"
            warm_up()
            os.sched_setscheduler(process.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
            yield
        except PermissionError as error:
            sys.exit(f"the plant must have real time: {error}")
        finally:
            process.kill()


@contextmanager
def load(processes: int) -> Iterator[None]:
    """Let a number of processes compute without a pause."""
    with ExitStack() as stack:
        for _ in range(processes):
            burning = subprocess.Popen((sys.executable, "-c", "while True: pass"))
            stack.callback(stack.enter_context(burning).kill)
        yield
