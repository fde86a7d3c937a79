"""Server of EtherCAT frames: received frames pass the slaves and are sent back."""

from __future__ import annotations

import errno
import os
import socket
import threading
from typing import TYPE_CHECKING, Any

import pytest
from ethercat_master import answers_of, frame_of
from ideal_machine import IdealMachine
from typer.testing import CliRunner

from sim_plant.__main__ import app
from sim_plant.ethercat.frame import Command
from sim_plant.ethercat.segment import Segment
from sim_plant.serving import raw_ethernet
from sim_plant.serving.raw_ethernet import open_interface, serve_frames

if TYPE_CHECKING:
    from sim_plant.slave_network import Clock

READ = frame_of((Command.BRD, 0, 0x130, bytes(2)))
COMING, LEAVING = 0, 4


class Wire:
    """Cable with some frames on it; the last one stops the server."""

    def __init__(self, stop: threading.Event, frames: list[tuple[bytes, int]], fails: int) -> None:
        self.sent: list[bytes] = []
        self._frames, self._stop, self._fails = frames, stop, fails
        self.ours, self.theirs = socket.socketpair()
        self.theirs.send(b"!")  # always readable

    def close(self) -> None:
        self.ours.close()
        self.theirs.close()

    def fileno(self) -> int:
        return self.ours.fileno()

    def recvfrom(self, _size: int, flags: int) -> tuple[bytes, tuple[str, int, int]]:
        assert flags == socket.MSG_DONTWAIT
        if not self._frames:
            raise BlockingIOError
        frame, kind = self._frames.pop(0)
        if not self._frames:
            self._stop.set()
        return frame, ("plant0", 0, kind)

    def send(self, frame: bytes) -> None:
        self._fails -= 1
        if self._fails >= 0:
            raise OSError(errno.ENOBUFS, "No buffer space available")
        self.sent.append(frame)


@pytest.mark.parametrize("clock", ["sync", "wall"])
def test_frames_that_come_in_are_answered_and_our_own_are_not(clock: Clock) -> None:
    stop = threading.Event()
    wire: Any = Wire(stop, [(READ, COMING), (READ, LEAVING), (READ, COMING)], fails=1)
    segment = Segment(IdealMachine(3), clock)
    segment.power_on()
    serve_frames(wire, segment, clock, stop)
    wire.close()
    assert len(wire.sent) == 1, "one of two found the queue full"
    assert answers_of(wire.sent[0])[0] == (b"\1\0", 3)
    assert wire.sent[0][6] & 2, "it has passed a slave"


@pytest.mark.parametrize(("clock", "sleeps"), [("sync", 1), ("wall", 2)])
def test_the_next_frame_of_a_master_in_lock_step_finds_the_server_awake(
    clock: Clock, sleeps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = threading.Event()
    wire: Any = Wire(stop, [(READ, COMING), (READ, COMING)], fails=0)
    slept: list[float] = []

    def select(_read: object, _write: object, _other: object, timeout: float) -> tuple[list[Any]]:
        slept.append(timeout)
        return ([wire],)

    monkeypatch.setattr(raw_ethernet.select, "select", select)
    segment = Segment(IdealMachine(3), clock)
    segment.power_on()
    serve_frames(wire, segment, clock, stop)
    wire.close()
    assert len(wire.sent) == 2
    assert len(slept) == sleeps


def test_other_systems_than_linux_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(raw_ethernet.socket, "AF_PACKET", raising=False)
    with pytest.raises(OSError, match="on Linux only"):
        open_interface("plant0")


def test_an_interface_that_there_is_not_is_named_with_those_that_there_are() -> None:
    command = ["--interface", "ethercat", "--channel", "nowhere0"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 1
    reason = "nowhere0: No such device; interfaces are lo" if os.geteuid() == 0 else "CAP_NET_RAW"
    assert reason in done.output
    done = CliRunner().invoke(app, [*command, "--bus-option", "a=1"])
    assert "not for interface ethercat" in done.output
