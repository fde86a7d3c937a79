"""Process for serving the live page of a run: `python -m hil.live.page_server`.

The process reads the run's lines from standard input (`hil.live.lines`) and serves them over HTTP
with Python's standard library alone, at a lower priority than the run, until the input ends. It
adds three kinds of line: ``alive`` at intervals, ``stopping`` after a page has requested a stop,
and ``end`` with ``lost`` if the run ended without a line ``end``.

Options after ADDRESS and PORT: ``--hand PATH``, socket for pushes of the virtual plant; ``--report
PATH``, report to be served once it exists; ``--while-open``, request a stop after the last page is
closed, or at the line ``report`` if no page was ever open.

`Streams` sends the lines to the pages; late pages get the state so far. One thread serves every
page and waits for none. A page that is behind misses samples, so that the next sample is recent; a
page is dropped if it takes nothing for `PATIENCE`, or has too much waiting. Lines go out as
server-sent events.
"""

from __future__ import annotations

import errno
import ipaddress
import json
import math
import os
import secrets
import select
import selectors
import socket
import sys
import time
from collections import deque
from contextlib import suppress
from http.server import ThreadingHTTPServer
from socketserver import TCPServer
from threading import Event, Lock, Semaphore, Thread
from typing import TYPE_CHECKING, Any, cast

from hil.live.listener import begin_listening, url_host
from hil.live.page_requests import (
    WAITING_MAX,
    Incoming,
    Requests,
    Site,
    TooLarge,
    Whole,
    takes_time,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


CONNECTIONS_MAX = 128
"""Maximum number of files and event streams answered in parallel, by a thread each."""
CLOSED = 8.0
"""Time without a page that counts as closed [s]; a reloaded page returns sooner."""
_BUSY = (
    b"HTTP/1.0 503 Service Unavailable\r\nContent-Type: text/plain\r\nRetry-After: 5\r\n\r\n"
    b"too many connections; close a page\n"
)


class PageServer(ThreadingHTTPServer):
    """HTTP server of the live page, with a thread per file or event stream.

    Short answers, such as a stop or a refusal, are sent at once by the thread that accepts
    connections, so that busy threads never delay a stop.

    Parameters
    ----------
    address : str
        IP address to listen on.
    port : int
        Port; 0 selects a free one.
    """

    daemon_threads = True
    request_queue_size = CONNECTIONS_MAX

    def __init__(self, address: str, port: int, site: Site) -> None:
        is_long = ipaddress.ip_address(address).version == 6
        self.address_family = socket.AF_INET6 if is_long else socket.AF_INET
        self._free = Semaphore(CONNECTIONS_MAX)
        self._site = site
        self._waiting: dict[Incoming, None] = {}  # in order of arrival
        self._selector = selectors.DefaultSelector()
        super().__init__((address, port), type("Requests", (Requests,), {"site": site}))

    def server_bind(self) -> None:
        """Bind the port, without the name lookup of `HTTPServer`."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = str(self.server_address[0]), self.server_address[1]

    def serve_forever(self, poll_interval: float = 0.5) -> None:
        """Accept connections, and answer complete requests."""
        self.socket.setblocking(False)
        self._selector.register(self.socket, selectors.EVENT_READ)
        while True:
            for key, _ in self._selector.select(poll_interval):
                if key.fileobj is self.socket:
                    self._accept()
                # any other connection was just closed in favour of a newer one
                elif key.data in self._waiting:
                    self._receive(key.data)
            now = time.monotonic()
            for late in [each for each in self._waiting if each.ends < now]:
                self._leave(late)

    def _accept(self) -> None:
        for _ in range(self.request_queue_size):
            try:
                connection, _ = self.socket.accept()
            except OSError:  # no other connection is pending, or it has been closed again
                return
            connection.setblocking(False)
            if len(self._waiting) >= WAITING_MAX:
                self._leave(next(iter(self._waiting)), _BUSY)
            incoming = Incoming(connection)
            self._waiting[incoming] = None
            self._selector.register(connection, selectors.EVENT_READ, incoming)
            self._receive(incoming)

    def _receive(self, incoming: Incoming) -> None:
        try:
            data = incoming.receive()
        except (OSError, TooLarge):
            self._leave(incoming)
        else:
            if data is None:
                return
            self._forget(incoming)
            request = Whole(incoming.connection, data)
            if not takes_time(data, self._site):
                self.process_request_thread(cast("Any", request), None)
            elif self._free.acquire(blocking=False):
                Thread(target=self._answer, args=(request,), daemon=True).start()
            else:
                self._close(request.connection, _BUSY)

    def _answer(self, request: Whole) -> None:
        request.connection.settimeout(Requests.timeout)
        try:
            self.process_request_thread(cast("Any", request), None)
        finally:
            self._free.release()

    def shutdown_request(self, request: Any) -> None:
        """Close the connection of a request."""
        self._close(request.connection)

    def _leave(self, incoming: Incoming, words: bytes = b"") -> None:
        self._forget(incoming)
        self._close(incoming.connection, words)

    def _forget(self, incoming: Incoming) -> None:
        del self._waiting[incoming]
        self._selector.unregister(incoming.connection)

    def _close(self, connection: socket.socket, words: bytes = b"") -> None:
        with suppress(OSError):  # the client has gone
            if words:
                connection.send(words)
            connection.shutdown(socket.SHUT_WR)
        connection.close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Suppress messages about broken connections, since the terminal belongs to the run."""


def main(address: str, port: str, *options: str) -> None:
    """Serve until the end of standard input."""
    hand, report = (
        options[options.index(name) + 1] if name in options else ""
        for name in ("--hand", "--report")
    )
    streams, say = Streams(), begin_listening()

    def stop() -> None:
        say("stop")
        streams.take(_line("stopping"))

    secret = "" if ipaddress.ip_address(address).is_loopback else secrets.token_urlsafe(16)
    try:
        server = PageServer(address, int(port), Site(streams, stop, secret, hand, report))
    except OSError as error:
        remedy = "choose another with --live PORT, or 0 for a free one"
        if error.errno == errno.EADDRNOTAVAIL:
            remedy = "give an address of this computer with --live-address, or 0.0.0.0 for all"
        where = f"port {port} of {address}: {error.strerror}; {remedy}"
        say("failed", f"the live page cannot be served on {where}")
        return
    Thread(target=server.serve_forever, name="server", daemon=True).start()
    found = address
    if secret and ipaddress.ip_address(address).is_unspecified:
        found = socket.gethostname()
    place, warning = "", ""
    if secret:
        place = f"{secret}/"
        warning = " (whoever has this address can watch and stop the run)"
    url = f"http://{url_host(found)}:{server.server_port}/{place}"
    say("ready", f"live page: {url}{warning}")
    _pass_on(streams, stop if "--while-open" in options else None)


def _pass_on(streams: Streams, closed: Callable[[], None] | None) -> None:
    """Forward the lines of standard input, and a sign of life every second.

    Pages have half a second to get the last line; `closed` is called once the last page is closed.
    """
    alive, seen = 0.0, math.inf
    for line in _lines(sys.stdin.fileno()):
        if line:
            streams.take(line)
        now = time.monotonic()
        if now - alive > 1.0:
            alive = now
            streams.take(_line("alive"))
        # a page may be open for less time than passes between two lines
        if streams.pages or (streams.opened and seen == math.inf):
            seen = now
        nobody = streams.reported and not streams.opened
        if closed is not None and (nobody or now - seen > CLOSED):
            closed()
            closed = None
    if not streams.ended:
        streams.take(_line("end", how="lost", text="the run has ended without a message"))
    until = time.monotonic() + 0.5
    while not streams.idle and time.monotonic() < until:
        time.sleep(0.01)
        streams.flush()


def _lines(descriptor: int) -> Iterator[bytes]:
    """Yield lines of input, and empty ones regularly without input."""
    rest = b""
    while True:
        if not select.select([descriptor], [], [], 0.1)[0]:
            yield b""
            continue
        chunk = os.read(descriptor, 65536)
        if not chunk:
            return
        *whole, rest = (rest + chunk).split(b"\n")
        yield from whole


def _line(kind: str, **values: object) -> bytes:
    return json.dumps({"kind": kind, "at": time.time(), **values}).encode()


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
            kind = str(said["kind"])
            if kind in {"note", "fault"} or said.get("notice"):
                self._history.append(chunk)
            if kind in {"armed", "off"}:
                self._state["power"] = chunk
            elif kind == "level":
                self._state[f"level of {said['axis']}"] = chunk
            elif kind in _STATES:
                self._state[kind] = chunk
            for client in self._clients:
                client.give(chunk, droppable=kind in DROPPABLE)
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

    def _sweep(self) -> None:
        self._clients = [client for client in self._clients if not client.left.is_set()]


if __name__ == "__main__":
    main(*sys.argv[1:])
