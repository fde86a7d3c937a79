"""Requests from a browser to the live page: page, assets, events, stop and push.

A page of another site may send requests through its visitor's browser. Therefore a request from
another origin is refused, and so is a stop or a push without a header that only our own page can
set. On addresses other than the loopback, every path begins with a secret. The loopback is
accessible to every user of this computer, so the connection must be from a program of this user.
The requested host must be an IP address or localhost, since a foreign DNS name may resolve to this
computer. The port of the host may differ, as with a tunnel.

A push acts on the virtual plant's arm alone. It is sent directly to the plant, as a datagram to the
plant's socket for pushes, never to the bus or to the process that runs the bus.

A request gets a thread only when complete; so a client that sends byte by byte, or nothing, holds
one of `WAITING_MAX` entries of a list and no thread: for `DEADLINE` at most, and until others need
the entry.
"""

from __future__ import annotations

import gzip
import hmac
import html
import io
import ipaddress
import json
import os
import re
import socket
import sys
import time
from dataclasses import dataclass, field
from functools import cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, cast
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from http.server import HTTPServer

    from typing_extensions import Buffer

    from hil.live.streams import Streams


DEADLINE = 5.0
"""Time limit for a complete request [s]: some ten round trips of a slow mobile network."""
WAITING_MAX = 128
"""Maximum number of connections without a complete request; a new one replaces the oldest."""
BODY_MAX = 4096
"""Maximum bytes of a body, sufficient for a push."""
REQUEST_MAX = 16_384 + BODY_MAX
"""Maximum bytes of a request; browsers send some 1 kB."""
_LENGTH = re.compile(rb"^content-length:[ \t]*(\d{1,9})[ \t]*\r?$", re.I | re.M)


class TooLarge(Exception):
    """Request of more than `REQUEST_MAX` bytes."""


@dataclass(slots=True, eq=False)
class Incoming:
    """Connection with a partial request.

    Attributes
    ----------
    connection : socket
        Non-blocking socket.
    ends : float
        End of the time limit, on the monotonic clock [s].
    """

    connection: socket.socket
    data: bytearray = field(default_factory=bytearray)
    ends: float = field(default_factory=lambda: time.monotonic() + DEADLINE)

    def receive(self) -> bytes | None:
        """Receive available data; return the request once complete.

        Raises
        ------
        OSError
            The connection is closed or broken.
        TooLarge
        """
        try:
            chunk = self.connection.recv(REQUEST_MAX)
        except BlockingIOError:
            return None
        if not chunk:
            raise ConnectionResetError
        self.data += chunk
        if len(self.data) > REQUEST_MAX:
            raise TooLarge
        head, end, body = bytes(self.data).partition(b"\r\n\r\n")
        length = _LENGTH.search(head)
        if end and len(body) >= min(int(length[1]) if length else 0, BODY_MAX):
            return bytes(self.data)
        return None


def is_ours(connection: socket.socket) -> bool:
    """Return True if the other end is a program of this user or of root, on this computer.

    The caller of `sudo` counts as this user. A connection already closed by its program belongs to
    nobody: the kernel states root as its user. On a system without this information, the result is
    True.
    """
    family = connection.family
    theirs, ours = connection.getpeername()[:2], connection.getsockname()[:2]
    wanted = f"{_format_address(family, *theirs)} {_format_address(family, *ours)}".encode()
    try:
        # columns: number, local address, remote address, state, queues, timers, retries, user,
        # timeout, inode (0 for closed sockets)
        table = Path("/proc/net/tcp6" if family == socket.AF_INET6 else "/proc/net/tcp")
        lines = table.read_bytes().splitlines()
    except OSError:
        return True
    found = next((line.split() for line in lines if wanted in line), [b"0"] * 10)
    owner, inode = int(found[7]), found[9]
    caller = os.environ.get("SUDO_UID", "")
    users = {0, os.getuid(), *([int(caller)] if caller.isdecimal() else [])}
    return inode != b"0" and owner in users


def _format_address(family: int, address: str, port: int) -> str:
    """Format an address as in the kernel's table: words of four bytes in machine order."""
    packed = socket.inet_pton(family, address)
    words = [packed[k : k + 4] for k in range(0, len(packed), 4)]
    return "".join(f"{int.from_bytes(word, sys.byteorder):08X}" for word in words) + f":{port:04X}"


ASSETS = Path(__file__).parent / "assets"
VIEW = Path(__file__).parents[1] / "view" / "assets"
SHOW = Path(__file__).parents[1] / "show" / "templates"
STRONGEST, LONGEST = 1e4, 1.0
"""Bounds of a push, equal to the plant's (`sim_plant.serving.hand`) [N m or N, s]."""
STOP_HEADER = "X-Hil-Stop"
PUSH_HEADER = "X-Hil-Push"
SECURITY = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src"
        " data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
OF_THE_REPORT = {
    **SECURITY,
    "Content-Security-Policy": "base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
}
"""Headers for the report, which states hashes of permitted scripts itself."""
PAGE = ""
FILES = {
    PAGE: ("text/html; charset=utf-8", (ASSETS / "page.html",)),
    "view.js": ("text/javascript; charset=utf-8", (VIEW / "view.js",)),
    "live.js": ("text/javascript; charset=utf-8", (ASSETS / "live.js",)),
    "live.css": (
        "text/css; charset=utf-8",
        (SHOW / "curves.css", VIEW / "view.css", ASSETS / "live.css"),
    ),
}
"""Media type and source files by path."""
HEADLINE = '<p id="headline" role="status">{}</p>'
"""Element of the page for the headline."""


class Site(NamedTuple):
    """Data of the served run.

    Attributes
    ----------
    stop : callable
        Function that requests a stop of the run.
    secret : str
        First part of every path; empty for none.
    hand : str
        Path of the socket by which the simulated arm is pushed; empty without such a plant.
    report : str
        Path of the run's report; empty before its creation.
    """

    streams: Streams
    stop: Callable[[], None]
    secret: str
    hand: str = ""
    report: str = ""


class Whole(NamedTuple):
    """Complete request."""

    connection: socket.socket
    data: bytes


def takes_time(data: bytes, site: Site) -> bool:
    """Return True if the answer takes time: a file, or the events of the run.

    The result is False without the secret.
    """
    method, _, rest = data.partition(b" ")
    place = _within(rest.partition(b" ")[0].decode("latin-1"), site.secret)
    return method == b"GET" and (place in ("events", "report") or place in FILES)


class Requests(BaseHTTPRequestHandler):
    """Handler of a single request; a subclass sets `site`."""

    site: Site
    server: HTTPServer
    timeout = 10.0  # time limit for a whole answer [s]

    def setup(self) -> None:
        """Set up streams for the request received and the connection."""
        whole = cast("Whole", self.request)
        self.connection = whole.connection
        self.rfile = io.BytesIO(whole.data)
        self.wfile = _Answer(self.connection)

    def do_GET(self) -> None:
        """Answer with a file, or with the events of the run."""
        place = self._place()
        if place is None:
            return
        if place == "events":
            head = "HTTP/1.0 200 OK\r\nContent-Type: text/event-stream\r\n"
            head += "".join(f"{name}: {value}\r\n" for name, value in SECURITY.items())
            client = self.site.streams.add(self.connection, f"{head}\r\n".encode())
            if client is None:
                self._text(HTTPStatus.SERVICE_UNAVAILABLE, "too many pages are open; close one")
            else:
                client.left.wait()
        elif place == PAGE:
            # answer with the page and its present headline, shown before any script has run
            kind, files = FILES[PAGE]
            headline = HEADLINE.format(html.escape(self.site.streams.headline))
            page = _content(files, compressed=False)
            content = page.replace(HEADLINE.format("").encode(), headline.encode())
            self._answer(HTTPStatus.OK, kind, content)
        elif place in FILES:
            kind, files = FILES[place]
            compressed = "gzip" in self.headers.get("Accept-Encoding", "")
            self._answer(HTTPStatus.OK, kind, _content(files, compressed), compressed)
        elif place == "report" and self.site.report and Path(self.site.report).is_file():
            self._answer(
                HTTPStatus.OK,
                "text/html; charset=utf-8",
                Path(self.site.report).read_bytes(),
                headers=OF_THE_REPORT,
            )
        else:
            self._text(HTTPStatus.NOT_FOUND, "there is no such page")

    def do_POST(self) -> None:
        """Stop the run, or push the plant's arm."""
        place = self._place()
        if place is None:
            return
        body = self.rfile.read()
        asked = {"stop": STOP_HEADER} | ({"push": PUSH_HEADER} if self.site.hand else {})
        if place not in asked:
            self._text(HTTPStatus.NOT_FOUND, "only stop can be requested")
        elif self.headers.get(asked[place]) != "1":
            self._text(HTTPStatus.FORBIDDEN, f"a {place} is accepted only from the live page")
        elif place == "push" and not _is_push(body):
            self._text(
                HTTPStatus.BAD_REQUEST,
                'a push must read {"torque": [a number per axis], "lasts": seconds}, torques within'
                f" +-{STRONGEST:g} N m or N, for at most {LONGEST:g} s",
            )
        elif self.site.streams.ended:
            self._text(HTTPStatus.CONFLICT, "the run has ended already")
        elif place == "push" and (reason := self.site.streams.closed):
            self._text(HTTPStatus.CONFLICT, reason)
        elif place == "push":
            try:
                with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as hand:
                    hand.setblocking(False)
                    hand.sendto(body, self.site.hand)
            except OSError:  # the plant is between two runs, or its queue is full
                self._text(HTTPStatus.SERVICE_UNAVAILABLE, "the arm cannot be pushed now")
            else:
                self._text(HTTPStatus.ACCEPTED, "pushed")
        else:
            self.site.stop()
            self._text(HTTPStatus.ACCEPTED, "the axes are being stopped")

    def version_string(self) -> str:
        """Return a server name without versions."""
        return "hil"

    def log_message(self, *args: object) -> None:
        """Suppress log messages, since the terminal belongs to the run."""

    def _place(self) -> str | None:
        host = self.headers.get("Host", "")
        origin = self.headers.get("Origin")
        if not self.site.secret and not _ours(host):
            self._text(
                HTTPStatus.FORBIDDEN,
                f"the page is not served under this name: open http://localhost:{self.server.server_port}/"
                " on the run's computer, or start the run with --live-address",
            )
            return None
        if origin is not None and origin != f"http://{host}":
            self._text(HTTPStatus.FORBIDDEN, "requests of other sites are refused")
            return None
        place = _within(self.path, self.site.secret)
        if place is None:
            self._text(HTTPStatus.FORBIDDEN, "the address lacks the secret that hil run has shown")
        elif not self.site.secret and not is_ours(self.connection):
            self._text(
                HTTPStatus.FORBIDDEN,
                "the page is served only to the user of the run; for others use --live-address",
            )
            return None
        return place

    def _text(self, status: HTTPStatus, text: str) -> None:
        self._answer(status, "text/plain; charset=utf-8", f"{text}\n".encode())

    def _answer(
        self,
        status: HTTPStatus,
        kind: str,
        content: bytes,
        compressed: bool = False,
        headers: Mapping[str, str] = SECURITY,
    ) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        if compressed:
            self.send_header("Content-Encoding", "gzip")
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)


class _Answer(io.BufferedIOBase):
    """Answer, written as a whole within the connection's timeout."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    def writable(self) -> bool:
        return True

    def write(self, content: Buffer) -> int:
        """Send the content completely, or raise an `OSError`."""
        self._connection.sendall(content)
        return memoryview(content).nbytes


@cache
def _content(files: tuple[Path, ...], compressed: bool) -> bytes:
    content = b"".join(file.read_bytes() for file in files)
    return gzip.compress(content, mtime=0) if compressed else content


def _within(path: str, secret: str) -> str | None:
    """Return the part of a path after the secret; None for a wrong secret."""
    place = path.partition("?")[0].removeprefix("/")
    if not secret:
        return place
    said, _, place = place.partition("/")
    return place if hmac.compare_digest(said.encode(), secret.encode()) else None


def _is_push(body: bytes) -> bool:
    try:
        said = json.loads(body)
        torques, lasts = [*said["torque"]], said["lasts"]
    except (ValueError, TypeError, KeyError, RecursionError):
        return False
    return (
        all(isinstance(each, (int, float)) for each in (*torques, lasts))
        and all(abs(each) <= STRONGEST for each in torques)  # NaN fails this comparison
        and 0 <= lasts <= LONGEST
    )


def _ours(host: str) -> bool:
    """Return True if the requested host is an IP address or localhost, not a foreign name."""
    try:
        parts = urlsplit(f"//{host}")
        parts.port  # noqa: B018 - raises for what is no number
        name = parts.hostname or ""
        return name == "localhost" or bool(ipaddress.ip_address(name))
    except ValueError:
        return False
