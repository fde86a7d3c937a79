"""Process for serving the live page of a run: `python -m hil.live.page_server`.

The process reads the run's lines from standard input (`hil.live.lines`) and serves them over HTTP
with Python's standard library alone, at a lower priority than the run, until the input ends. It
adds three kinds of line: ``alive`` at intervals, ``stopping`` after a page has requested a stop,
and ``end`` with ``lost`` if the run ended without a line ``end``.

Options after ADDRESS and PORT: ``--hand PATH``, socket for pushes of the virtual plant; ``--report
PATH``, report to be served once it exists; ``--while-open``, request a stop after the last page is
closed, or at the line ``report`` if no page was ever open.
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
from contextlib import suppress
from http.server import ThreadingHTTPServer
from socketserver import TCPServer
from threading import Semaphore, Thread
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
from hil.live.streams import Streams

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


if __name__ == "__main__":
    main(*sys.argv[1:])
