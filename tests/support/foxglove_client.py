"""Minimal client of Foxglove's WebSocket protocol: subscribes to all channels and keeps messages.

The protocol: github.com/foxglove/ws-protocol, docs/spec.md.
"""

from __future__ import annotations

import json
import struct
import time
from contextlib import ExitStack, contextmanager
from threading import Thread
from typing import TYPE_CHECKING, Any, NamedTuple

from rosbags.typesys import Stores, get_typestore
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from types import TracebackType
    from typing import Self

    from websockets.sync.client import ClientConnection

PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
PATIENCE = 20.0
_ROS = get_typestore(Stores.ROS2_HUMBLE)
_HEAD = struct.Struct("<BIQ")


class Message(NamedTuple):
    stamp: int
    content: Any


@contextmanager
def connected(port: int, **options: Any) -> Iterator[ClientConnection]:
    """Connect to the server as soon as it accepts connections."""
    end = time.monotonic() + PATIENCE
    with ExitStack() as stack:
        while True:
            try:
                address = f"ws://127.0.0.1:{port}"
                asked = connect(address, subprotocols=PROTOCOLS, close_timeout=1.0, **options)
                client = stack.enter_context(asked)
                break
            except OSError:
                if time.monotonic() > end:
                    raise
                time.sleep(0.01)
        yield client


def subscribe(client: ClientConnection, channels: Iterable[int]) -> None:
    """Subscribe to channels, with their own numbers."""
    wanted = [{"id": channel, "channelId": channel} for channel in channels]
    client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))


class FoxgloveClient:
    """Client that listens in a thread while entered, and then until the server has closed.

    It connects as soon as the server accepts connections.
    """

    def __init__(self, port: int) -> None:
        self.info: dict[str, Any] = {}
        self.channels: dict[int, dict[str, Any]] = {}
        self._data: list[bytes] = []
        self._port = port
        self._thread = Thread(target=self._listen)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()

    def select(self, topic: str) -> list[Message]:
        """Return messages of a topic in order of arrival."""
        (channel,) = (each for each in self.channels.values() if each["topic"] == topic)
        heads = [(_HEAD.unpack_from(data), data[_HEAD.size :]) for data in self._data]
        assert {kind for (kind, _, _), _ in heads} == {1}
        return [
            Message(stamp, _ROS.deserialize_cdr(data, channel["schemaName"]))
            for (_, number, stamp), data in heads
            if number == channel["id"]
        ]

    def _listen(self) -> None:
        with connected(self._port) as client:
            try:
                for data in client:
                    if isinstance(data, bytes):
                        self._data.append(data)
                    else:
                        self._take(client, json.loads(data))
            except ConnectionClosed:
                return

    def _take(self, client: ClientConnection, said: dict[str, Any]) -> None:
        if said["op"] == "serverInfo":
            self.info = said
        elif said["op"] == "advertise":
            self.channels |= {each["id"]: each for each in said["channels"]}
            subscribe(client, [each["id"] for each in said["channels"]])
