"""Listener: a process informed of a run without blocking the run; both ends.

The run writes lines (`hil.live.lines`) to the listener's standard input, a pipe, as far as there is
room: for a slow reader samples are left out, and other lines wait in a small buffer. The listener
answers on standard output by JSON lines with ``kind``: first ``ready`` or ``failed`` with a
``text``, then ``stop`` to request a stop of the axes, and lines for other listeners. It has a
process session of its own, so that Ctrl-C at the terminal ends only the run. The listener ends with
its input.
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
from typing import IO, TYPE_CHECKING, Any, cast

from checked_files.errors import HilError

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import BinaryIO

LAST_WORDS = 1.0
"""Wait of an ending run for a slow reader, and for the reader's end [s]."""
ANSWERS = 10.0
"""Wait for the end of a listener with pending answers, once the axes are off [s]."""


class ListenerFailed(HilError):
    """Failure of a display process to start; nothing has moved."""


class Listener:
    """Process informed of a run's events.

    Parameters
    ----------
    what : str
        Name in messages, such as "the live page".
    module : str
        Python module to run; it must need neither numerics nor the bus.
    arguments : str
        Arguments of the module's command line.
    answers : bool
        True if the process sends lines to other listeners, awaited after the run.

    Attributes
    ----------
    gone : bool
        True once the process has ended, detected at a write or by the reader.
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

    def launch(self, stop: Callable[[], None]) -> None:
        """Start the process without waiting until it is ready; a second call has no effect.

        Parameters
        ----------
        stop : callable
            Function called from another thread when the process requests a stop, at most once.
        """
        if self._process is not None:
            return
        # the package may be run without installation
        environment, root = dict(os.environ), str(Path(__file__).parents[2])
        if root != sysconfig.get_path("purelib"):
            path = filter(None, (root, os.environ.get("PYTHONPATH")))
            environment["PYTHONPATH"] = os.pathsep.join(path)
        self._process = subprocess.Popen(  # noqa: S603 - our own program
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
            bufsize=0,
        )
        self._input = cast("IO[bytes]", self._process.stdin).fileno()
        os.set_blocking(self._input, False)
        ear = self._process.stdout, stop
        self._ear = Thread(target=self._hear, args=ear, name=self.what, daemon=True)
        self._ear.start()

    def start(self, stop: Callable[[], None], patience: float = 20.0) -> str:
        """Start the process if not launched; return the message of readiness.

        Parameters
        ----------
        stop : callable
            See `launch`.
        patience : float
            Maximum time until the process is ready [s]; nothing moves before.

        Raises
        ------
        ListenerFailed
            A process unable to serve.
        """
        self.launch(stop)
        try:
            first = self._first.get(timeout=patience)
        except Empty:
            first = {"text": f"{self.what} was not ready within {patience:g} s"}
        if first.get("kind") == "ready":
            return str(first["text"])
        self.close()
        raise ListenerFailed(f"{first['text']}; nothing has moved")

    def write(self, line: bytes, *, droppable: bool = False) -> None:
        """Write a line; skip a `droppable` line if the reader is behind.

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
        """Wait briefly for the reader, and end the process.

        Parameters
        ----------
        patience : float
            Maximum wait for the process's end [s].
        """
        if self._process is None:
            return
        until = time.monotonic() + LAST_WORDS
        while self._waiting and not self.gone and time.monotonic() < until:
            time.sleep(0.01)
            self._flush()
        self.gone = True
        cast("IO[bytes]", self._process.stdin).close()
        try:
            self._process.wait(patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._ear.is_alive():
            self._ear.join()  # a later stop request would have no receiver

    def _flush(self) -> None:
        try:
            while self._waiting:
                written = os.write(self._input, self._waiting)
                del self._waiting[:written]
        except BlockingIOError:  # the reader is behind
            return
        except OSError:  # the process has ended
            self.gone = True

    def _hear(self, output: BinaryIO, stop: Callable[[], None]) -> None:
        """Receive the process's lines until the end."""
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


def begin_listening() -> Callable[..., None]:
    """Lower the priority of this process; return the function for messages to the run.

    The function takes a kind of line, and its text or other values, from any thread.
    """
    os.nice(10)
    lock = Lock()

    def say(kind: str, text: str = "", **values: object) -> None:
        with lock:
            sys.stdout.write(json.dumps({"kind": kind, **(values or {"text": text})}) + "\n")
            sys.stdout.flush()

    return say


def encode(kind: str, **values: object) -> bytes:
    """Encode a line, with line end."""
    line = {"kind": kind, "at": round(time.time(), 3), **values}
    return json.dumps(line, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def url_host(address: str) -> str:
    """Format an IP address for a URL."""
    return f"[{address}]" if ":" in address else address
