"""Files written beside the motion, so that a disk that stalls does not stop the robot.

The drives stop by themselves when our heartbeat stays away for half a second, and whoever waits for
a disk sends none. So what is to be written is handed to one worker thread, in order, while the
sequencer travels on. What goes wrong there surfaces at the next event. When too much is waiting, or
when all is done and the axes are off, the disk is waited for after all: nothing counts as finished
before it has been written.
"""

from __future__ import annotations

import logging
import queue
import time
from threading import Thread
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType
    from typing import Self

log = logging.getLogger(__name__)

WAITING_MAX = 8
"""How many recordings may wait for the disk: a minute or two of measuring."""
LOOK = 0.005
"""How often a place among them is looked for [s]."""
PATIENCE = 30.0
"""How long a full queue may stand still before the campaign is given up [s]."""


class Background:
    """Carries out tasks one after the other in a thread; leaving waits for all of them.

    Parameters
    ----------
    waiting_max : int
        How many tasks may wait.
    patience : float
        How long `do` waits for a place among them [s].
    """

    def __init__(self, waiting_max: int = WAITING_MAX, patience: float = PATIENCE) -> None:
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

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Wait until everything is written.

        Raises
        ------
        FileError
            Something could not be; where another exception is under way this is logged instead.
        """
        self._tasks.put(None)
        self._worker.join()
        raised = 0 if exc else 1
        for error in self._failed[raised:]:
            log.error("%s", error)
        if exc is None:
            self.check()

    def do(self, task: Callable[[], None]) -> None:
        """Have `task` carried out after those before it.

        Raises
        ------
        FileError
            The disk takes nothing any more.
        """
        ends = time.monotonic() + self._patience
        while self._tasks.qsize() >= self._waiting_max:
            if time.monotonic() > ends:
                raise FileError(
                    f"the disk has finished no file for {self._patience:g} s with"
                    f" {self._waiting_max} waiting; see what holds it up, then go on with --resume"
                )
            time.sleep(LOOK)
        self._tasks.put(task)

    def check(self) -> None:
        """Raise what went wrong since last asked.

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
