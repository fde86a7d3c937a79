"""Process that serves the live page, and its clients, without a run."""

from __future__ import annotations

import http.client
import json
import re
import socket
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hil.live import lines
from hil.live.listener import Listener, encode

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from drivers.drive_bus import AxisInfo, Sample
    from hil.model.robot import Robot
    from hil.planning.plan import Plan

SERVER = "hil.live.page_server"
STOP = {"X-Hil-Stop": "1"}
PUSH = {"X-Hil-Push": "1"}


@dataclass
class Served:
    """Served page.

    Attributes
    ----------
    stops : list of int
        One element per requested stop.
    """

    listener: Listener
    stops: list[int] = field(default_factory=list)
    url: str = ""

    @property
    def port(self) -> int:
        found = re.search(r":(\d+)/", self.url)
        assert found
        return int(found[1])

    @property
    def path(self) -> str:
        return self.url.partition(f":{self.port}")[2]

    def publish(self, kind: str, **values: object) -> None:
        self.listener.write(encode(kind, **values))

    def begin(
        self, robot: Robot, plan: Plan, axes: tuple[AxisInfo, ...], *, pushed: bool = False
    ) -> None:
        """Publish the first lines of a run; with `pushed`, of a watched run that accepts pushes."""
        kind = {"simulated": True, "hand": pushed, "watched": pushed}
        self.publish("start", **lines.start(robot, plan, None, **kind))
        self.publish("armed", **lines.armed(axes))

    def sample(self, sample: Sample) -> None:
        self.publish("sample", **lines.sample(sample))

    def ask(
        self, method: str, path: str, headers: dict[str, str] | None = None, body: str = ""
    ) -> tuple[int, http.client.HTTPMessage, str]:
        """Send a request over the loopback interface; return status, headers and text."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        try:
            given = {"Host": f"127.0.0.1:{self.port}", **(headers or {})}
            connection.request(method, path, body or None, given)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read().decode()
        finally:
            connection.close()


@contextmanager
def served(address: str = "127.0.0.1", port: int = 0, *options: str) -> Iterator[Served]:
    """Serve a page on a free port."""
    listener = Listener("the live page", SERVER, address, str(port), *options)
    found = Served(listener)
    text = listener.start(lambda: found.stops.append(1))
    match = re.search(r"http://\S+", text)
    assert match
    found.url = match[0]
    try:
        yield found
    finally:
        listener.close()


@contextmanager
def hand(path: Path) -> Iterator[socket.socket]:
    """Act as a plant that accepts pushes."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as taken:
        taken.bind(str(path))
        taken.settimeout(30)
        yield taken


def watching(port: int, path: str = "/events") -> socket.socket:
    """Open a page's stream of events without reading from it."""
    connection = socket.create_connection(("127.0.0.1", port), timeout=30)
    request = f"GET {path} HTTP/1.0\r\nHost: 127.0.0.1:{port}\r\n\r\n"
    connection.sendall(request.encode())
    return connection


def events(connection: socket.socket) -> Iterator[dict[str, Any]]:
    """Yield lines of the run as received by a page; raise OSError after the end of the server."""
    with connection.makefile("rb") as stream:
        for text in stream:
            if text.startswith(b"data: "):
                yield json.loads(text.removeprefix(b"data: "))
