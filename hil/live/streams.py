"""Event streams from a run to pages; late pages get the state so far.

One thread serves every page and waits for none. A page that is behind misses samples, so that the
next sample is recent; a page is dropped if it takes nothing for `PATIENCE`, or has too much
waiting. Lines go out as server-sent events.
"""

from __future__ import annotations

import json
import socket
import time
from collections import deque
from threading import Event, Lock

CLIENTS_MAX = 64
"""Maximum number of pages."""
DROPPABLE = frozenset({"sample", "torque"})
"""Kinds of lines skipped for slow pages."""
_STATES = frozenset(
    {"start", "event", "sample", "stopping", "headline", "hand", "estimate", "report", "end"}
)
"""Kinds of lines whose latest line is sent to a late page."""
PATIENCE = 10.0
"""Maximum time without progress of a page [s]."""


class Client:
    """Connection of a page.

    Attributes
    ----------
    left : Event
        Set at the end of the connection.
    """

    def __init__(self, connection: socket.socket, first: bytes) -> None:
        self.left = Event()
        connection.setsockopt(
            socket.SOL_SOCKET, socket.SO_SNDBUF, 16_384
        )  # data in a larger buffer would be outdated
        connection.setblocking(False)
        self._connection = connection
        self._waiting = bytearray(first)
        self._took = time.monotonic()

    @property
    def is_behind(self) -> bool:
        """True if data waits for the page."""
        return bool(self._waiting)

    def give(self, chunk: bytes, *, droppable: bool) -> None:
        """Send a chunk; skip a `droppable` chunk if the page is behind."""
        if not (droppable and self._waiting):
            self._waiting += chunk
        self.flush()

    def flush(self) -> None:
        """Send waiting data; drop a page with 1 MB waiting or without progress."""
        now = time.monotonic()
        try:
            while self._waiting:
                del self._waiting[: self._connection.send(self._waiting)]
                self._took = now
        except BlockingIOError:
            if now - self._took > PATIENCE or len(self._waiting) > 1_000_000:
                self.left.set()
        except OSError:  # the page has gone
            self.left.set()
        else:
            self._took = now


class Streams:
    """State of a run for pages, and the pages.

    Attributes
    ----------
    opened : bool
        True after the first page was opened.
    """

    def __init__(self) -> None:
        self.opened = False
        self._lock = Lock()
        self._clients: list[Client] = []
        self._state: dict[str, bytes] = {}
        self._history: deque[bytes] = deque(maxlen=200)  # notices for late pages

    @property
    def ended(self) -> bool:
        """True after the run's last line."""
        return "end" in self._state

    @property
    def reported(self) -> bool:
        """True once the report exists; the measurement is over."""
        return "report" in self._state

    @property
    def headline(self) -> str:
        """Text of the last headline; empty without one."""
        return self._latest("headline", "text")

    @property
    def closed(self) -> str:
        """Reason why the arm cannot be pushed at present; empty if pushes are possible."""
        return self._latest("hand", "closed")

    @property
    def pages(self) -> int:
        """Number of pages."""
        with self._lock:
            return len(self._clients)

    @property
    def idle(self) -> bool:
        """True if no page has data waiting."""
        with self._lock:
            return not any(client.is_behind for client in self._clients)

    def add(self, connection: socket.socket, head: bytes) -> Client | None:
        """Add a page; None if the maximum is reached."""
        with self._lock:
            self._sweep()
            if len(self._clients) >= CLIENTS_MAX:
                return None
            state = dict(self._state)
            first, last = state.pop("start", b""), state.pop("end", b"")
            client = Client(
                connection, head + b"".join([first, *self._history, *state.values(), last])
            )
            self._clients.append(client)
            self.opened = True
            client.flush()
            return client

    def take(self, line: bytes) -> None:
        """Forward a line of the run; skip a truncated line."""
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
        """Send waiting data to the pages."""
        with self._lock:
            for client in self._clients:
                client.flush()
            self._sweep()

    def _latest(self, kind: str, name: str) -> str:
        chunk = self._state.get(kind, b"data: {}")
        return str(json.loads(chunk.removeprefix(b"data: ")).get(name, ""))

    def _keep(self, said: dict[str, object], chunk: bytes) -> None:
        """Store a line needed by late pages."""
        kind = str(said["kind"])
        if kind in {"note", "fault"} or said.get("notice"):
            self._history.append(chunk)
        if kind in {"armed", "off"}:
            self._state["power"] = chunk
        elif kind == "level":
            self._state[f"level of {said['axis']}"] = chunk
        elif kind in _STATES:
            self._state[kind] = chunk

    def _sweep(self) -> None:
        self._clients = [client for client in self._clients if not client.left.is_set()]
