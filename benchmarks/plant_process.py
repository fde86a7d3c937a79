"""The virtual plant as a separate process, also in real time; processes as load."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

from hil.cli.doctor import PRIORITY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@contextmanager
def served(interface: str, channel: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Serve the plant from another process, which is ready when this function yields."""
    place = ("--interface", interface, "--channel", channel)
    command = (sys.executable, "-m", "sim_plant", *place, *options)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline(), "the plant did not start"
            yield process
        finally:
            process.kill()


@contextmanager
def plant(
    interface: str, channel: str, warm_up: Callable[[], object] = lambda: None
) -> Iterator[None]:
    """Serve the plant in real time; `warm_up` runs before the switch to the real-time class."""
    with served(interface, channel, "--clock", "wall") as process:
        warm_up()
        make_real_time(process.pid)
        yield


def make_real_time(process: int) -> None:
    """Give a process the real-time class."""
    try:
        os.sched_setscheduler(process, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError as error:
        sys.exit(f"the plant must have real time: {error}")


@contextmanager
def load(processes: int) -> Iterator[None]:
    """Let a number of processes compute without a pause."""
    with ExitStack() as stack:
        for _ in range(processes):
            burning = subprocess.Popen((sys.executable, "-c", "while True: pass"))
            stack.callback(stack.enter_context(burning).kill)
        yield
