"""Raw frames on an interface, here one end of a socket pair."""

from __future__ import annotations

import socket
from typing import TYPE_CHECKING

import pytest

from drivers import sync_clock
from drivers.ethercat import wire as module
from drivers.ethercat.wire import RawWire

if TYPE_CHECKING:
    from collections.abc import Iterator

FRAME = b"\1" * 60


class Cable(socket.socket):
    """Substitute for a socket of an interface, bound to any address."""

    def bind(self, address: object) -> None:
        assert address == ("eth0", 0x88A4)


@pytest.fixture
def cable(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[RawWire, socket.socket]]:
    """Return a wire and the far end of its cable."""
    ours, theirs = socket.socketpair(type=socket.SOCK_DGRAM)
    near = Cable(fileno=ours.detach())
    monkeypatch.setattr(module.socket, "socket", lambda *_: near)
    yield RawWire("eth0"), theirs
    near.close()
    theirs.close()


def test_frames_go_out_and_come_back_or_not_in_time(cable: tuple[RawWire, socket.socket]) -> None:
    wire, there = cable
    assert wire.send(FRAME)
    assert there.recv(100) == FRAME
    there.send(FRAME)
    assert wire.receive(0.01) == FRAME
    assert wire.receive(0.01) is None
    assert wire.receive(0.1) is None


def test_an_answer_that_comes_at_once_finds_us_awake_where_we_may_wait_long(
    cable: tuple[RawWire, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    wire, there = cable
    monkeypatch.setattr(sync_clock.os, "sched_yield", lambda: there.send(FRAME))
    monkeypatch.setattr(sync_clock.time, "perf_counter", lambda: 0.0)  # busy machines stall
    assert wire.receive(0.5) == FRAME
    assert not wire._blocks, "it went to sleep"
