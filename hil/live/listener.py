"""A process beside the run that is informed of what happens, and never waited for: both its ends.

Its standard input is a pipe that the run writes lines to (`hil.live.lines`) as far as there is
room: where the reader is behind, samples are left out, and what matters waits in a small buffer.
What it has to say comes back by its standard output, as JSON lines with ``kind`` too: ``ready`` or
``failed`` with a ``text`` first, ``stop`` where somebody wants the axes stopped, and lines for the
other processes. It is in a session of its own, so that Ctrl-C at the terminal ends the run and not
it; the end of its input is its end.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import time
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from checked_files.errors import HilError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import BinaryIO

LAST_WORDS = 1.0
"""How long the end of a run waits for a reader that is behind, and for its own end [s]."""
ANSWERS = 10.0
"""The same for one that has something to say to the others, once the axes are off [s]."""


class ListenerFailed(HilError):
    """A process that shows the run cannot serve; nothing has moved."""


class Listener:
    """A process that is informed of what happens.

    Parameters
    ----------
    what : str
        Its name in messages, such as "the live page".
    module : str
        What Python runs; it must need neither numerics nor the bus.
    arguments : str
        Of the module's command line.
    answers : bool
        Whether it has lines for the others, which a run that has finished waits for.

    Attributes
    ----------
    what : str
    answers : bool
    gone : bool
        Whether the process has ended; noticed when something is written, or by itself.
    dropped : int
        Lines left out because the reader was behind.
    said : SimpleQueue of dict
        Lines for the other processes, with ``kind``.
    """

    def __init__(self, what: str, module: str, *arguments: str, answers: bool = False) -> None:
        self.what = what
        self.answers = answers
        self.gone = False
        self.dropped = 0
        self._command = [sys.executable, "-P", "-m", module, *arguments]
        self._waiting = bytearray()
        self._first: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self.said: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._process: subprocess.Popen[bytes] | None = None
        self._input = -1
        self._ear = Thread()

    def start(self, stop: Callable[[], None], patience: float = 20.0) -> str:
        """Start the process; return what it states once it is ready.

        Parameters
        ----------
        stop : callable
            Called, from another thread, where the process asks for a stop; once at most.
        patience : float
            How long the process may take to be ready [s]; nothing moves before.

        Raises
        ------
        ListenerFailed
            It cannot serve.
        """
        self._process = subprocess.Popen(  # noqa: S603 - our own program
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=_environment(),
            start_new_session=True,
            bufsize=0,
        )
        assert self._process.stdin is not None  # noqa: S101 - a pipe
        assert self._process.stdout is not None  # noqa: S101 - a pipe
        self._input = self._process.stdin.fileno()
        os.set_blocking(self._input, False)
        self._ear = Thread(
            target=self._hear, args=(self._process.stdout, stop), name=self.what, daemon=True
        )
        self._ear.start()
        return self._ready(patience)

    def write(self, line: bytes, *, droppable: bool = False) -> None:
        """Pass a line on; one that is `droppable` is left out while the reader is behind.

        At most 256 KiB wait for a reader.
        """
        if self.gone:
            return
        if self._waiting and (droppable or len(self._waiting) + len(line) > 262_144):
            self.dropped += 1
        else:
            self._waiting += line
        self._flush()

    def close(self, patience: float = LAST_WORDS) -> None:
        """Give it a moment to read what waits, and end it.

        Parameters
        ----------
        patience : float
            How long its own end is waited for [s].
        """
        if self._process is None:
            return
        until = time.monotonic() + LAST_WORDS
        while self._waiting and not self.gone and time.monotonic() < until:
            time.sleep(0.01)
            self._flush()
        self._end(self._process, patience)

    def _end(self, process: subprocess.Popen[bytes], patience: float) -> None:
        self.gone = True
        assert process.stdin is not None  # noqa: S101 - a pipe
        process.stdin.close()
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if self._ear.is_alive():
            self._ear.join()  # a stop that came later would find nobody who takes it

    def _flush(self) -> None:
        try:
            while self._waiting:
                written = os.write(self._input, self._waiting)
                del self._waiting[:written]
        except BlockingIOError:  # it is behind
            return
        except OSError:  # it has ended
            self.gone = True

    def _ready(self, patience: float) -> str:
        try:
            first = self._first.get(timeout=patience)
        except Empty:
            first = {"text": f"{self.what} was not ready within {patience:g} s"}
        if first.get("kind") == "ready":
            return str(first["text"])
        self.close()
        raise ListenerFailed(f"{first['text']}; nothing has moved")

    def _hear(self, output: BinaryIO, stop: Callable[[], None]) -> None:
        """Take what the process says, until its end."""
        stopped = False
        with output:
            for line in output:
                said = json.loads(line)
                if said["kind"] in ("ready", "failed"):
                    self._first.put(said)
                elif said["kind"] != "stop":
                    self.said.put(said)
                elif not (stopped or self.gone):
                    stopped = True
                    stop()
        self._first.put({"text": f"{self.what} ended before it was ready"})
        self.gone = True


def _environment() -> dict[str, str]:
    """Ours, in which a checkout that is not installed is found as well."""
    root = str(Path(__file__).parents[2])
    if root == sysconfig.get_path("purelib"):
        return dict(os.environ)
    path = filter(None, (root, os.environ.get("PYTHONPATH")))
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path)}


def begin_listening() -> Callable[..., None]:
    """Let the run go first; return what says something to it, from any thread.

    For the process itself: a kind of line, and its text or what else stands in it.
    """
    os.nice(10)
    lock = Lock()

    def say(kind: str, text: str = "", **values: object) -> None:
        with lock:
            sys.stdout.write(json.dumps({"kind": kind, **(values or {"text": text})}) + "\n")
            sys.stdout.flush()

    return say


def url_host(address: str) -> str:
    """Return an IP address as it stands in a URL."""
    return f"[{address}]" if ":" in address else address
