"""The lines of a run, passed on to any number of pages; what has passed reaches a late one too.

One thread gives every page what has come; none is waited for. A page that is behind misses
samples, so that the next one that it gets is new; one that takes nothing for `PATIENCE`, or has too
much waiting, is left. Lines go out as server-sent events.
"""

from __future__ import annotations

import json
import socket
import time
from collections import deque
from threading import Event, Lock

CLIENTS_MAX = 64
"""Pages that are served at a time."""
DROPPABLE = frozenset({"sample", "torque"})
"""Kinds of lines that a page that is behind can do without."""
_STATES = frozenset(
    {"start", "event", "sample", "stopping", "headline", "estimate", "report", "end"}
)
"""Kinds of which a late page gets the last line."""
PATIENCE = 10.0
"""How long a page may take nothing [s]."""


class Client:
    """A page's connection.

    Attributes
    ----------
    left : Event
        Set once the page is not served any more.
    """

    def __init__(self, connection: socket.socket, first: bytes) -> None:
        self.left = Event()
        connection.setsockopt(
            socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384
        )  # what lies there gets old
        connection.setblocking(False)
        self._connection = connection
        self._waiting = bytearray(first)
        self._took = time.monotonic()

    @property
    def behind(self) -> bool:
        """Whether something waits for the page."""
        return bool(self._waiting)

    def give(self, chunk: bytes, *, droppable: bool) -> None:
        """Pass on what has come; what is `droppable` is left out while the page is behind."""
        if not (droppable and self._waiting):
            self._waiting += chunk
        self.flush()

    def flush(self) -> None:
        """Send as much as the page takes; one that leaves 1 MB waiting is left, too."""
        now = time.monotonic()
        try:
            while self._waiting:
                del self._waiting[: self._connection.send(self._waiting)]
                self._took = now
        except BlockingIOError:
            if now - self._took > PATIENCE or len(self._waiting) > 1_000_000:
                self.left.set()
        except OSError:  # it has gone
            self.left.set()
        else:
            self._took = now


class Streams:
    """What all pages are to know, and the pages."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._clients: list[Client] = []
        self._state: dict[str, bytes] = {}
        self._history: deque[bytes] = deque(maxlen=200)  # notices that a late page still gets

    @property
    def ended(self) -> bool:
        """Whether the run's last line has come."""
        return "end" in self._state

    @property
    def reported(self) -> bool:
        """Whether the report is there: nothing is measured any more."""
        return "report" in self._state

    @property
    def pages(self) -> int:
        """How many pages are served."""
        with self._lock:
            return len(self._clients)

    @property
    def idle(self) -> bool:
        """Whether no page has anything waiting."""
        with self._lock:
            return not any(client.behind for client in self._clients)

    def add(self, connection: socket.socket, head: bytes) -> Client | None:
        """Serve a page from now on; None where there are too many."""
        with self._lock:
            self._sweep()
            if len(self._clients) >= CLIENTS_MAX:
                return None
            client = Client(connection, head + self._passed())
            self._clients.append(client)
            client.flush()
            return client

    def take(self, line: bytes) -> None:
        """Pass a line of the run on; one that was cut off is left out."""
        try:
            said = json.loads(line)
        except ValueError:
            return
        chunk = b"data: " + line.strip() + b"\n\n"
        with self._lock:
            self._keep(said, chunk)
            for client in self._clients:
                client.give(chunk, droppable=said["kind"] in DROPPABLE)
            self._sweep()

    def flush(self) -> None:
        """Send what waits, where pages take it."""
        with self._lock:
            for client in self._clients:
                client.flush()
            self._sweep()

    def _keep(self, said: dict[str, object], chunk: bytes) -> None:
        """Keep what a late page must know."""
        kind = str(said["kind"])
        if kind in {"note", "fault"} or said.get("notice"):
            self._history.append(chunk)
        if kind in {"armed", "off"}:
            self._state["power"] = chunk
        elif kind == "level":
            self._state[f"level of {said['axis']}"] = chunk
        elif kind in _STATES:
            self._state[kind] = chunk

    def _passed(self) -> bytes:
        state = dict(self._state)
        first, last = state.pop("start", b""), state.pop("end", b"")
        return b"".join([first, *self._history, *state.values(), last])

    def _sweep(self) -> None:
        self._clients = [client for client in self._clients if not client.left.is_set()]
