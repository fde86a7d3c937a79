"""Pushes from outside, independent of the bus."""

from __future__ import annotations

import json
import socket
import threading
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest

from checked_files.yaml_file import FileError
from sim_plant.physics import state as st
from sim_plant.serving.hand import LONGEST, STRONGEST, Hand
from sim_plant.serving.plant_channel import _channels
from sim_plant.serving.server import serve
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from pathlib import Path

PUSH = [0.0, 30.0, 0.0, -2.0, 0.0, 0.0]
SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "hand"


def push(path: Path, torque: object = PUSH, lasts: object = 0.2) -> None:
    datagram(path, json.dumps({"torque": torque, "lasts": lasts}).encode())


def datagram(path: Path, data: bytes) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.sendto(data, str(path))


def test_a_push_lasts_as_long_as_it_says_and_the_next_one_goes_on(path: Path) -> None:
    plant = load_machine("manutec-r15")
    hand = Hand(str(path), plant)
    pushed = plant.state[:, st.PUSH]
    push(path)
    hand.act(10.0)
    assert pushed.tolist() == PUSH
    push(path, [1.0] * 6, 0.5)
    hand.act(10.1)
    hand.act(10.59)
    assert pushed.tolist() == [1.0] * 6
    hand.act(10.6)
    assert not pushed.any()
    push(path, lasts=1e9)
    hand.act(20.0)
    hand.act(20.0 + LONGEST)
    assert not pushed.any()
    push(path, [1e300, -1e300, 0, 0, 0, 0])
    hand.act(30.0)
    assert pushed.tolist() == [STRONGEST, -STRONGEST, 0, 0, 0, 0]
    hand.close()
    assert not pushed.any()
    assert not path.exists()


@pytest.mark.parametrize(
    "data",
    [
        *(b"", b"{", b"[]", b"7", b"\xff\xfe", b"[" * 3000),
        b'{"torque": [1, 2, 3], "lasts": 0.2}',
        b'{"torque": [1, 2, 3, 4, 5, NaN], "lasts": 0.2}',
        b'{"torque": [1, 2, 3, 4, 5, "x"], "lasts": 0.2}',
        b'{"torque": [1, 2, 3, 4, 5, 6], "lasts": NaN}',
        b'{"torque": [1, 2, 3, 4, 5, 6]}',
        b'{"torque": [1, 2, 3, 4, 5, 6], "lasts": 1%b}' % (b"0" * 400),
        b'{"torque": [1, 2, 3, 4, 5, 1%b], "lasts": 1}' % (b"0" * 400),
    ],
)
def test_what_is_no_push_moves_nothing(path: Path, data: bytes) -> None:
    plant = load_machine("manutec-r15")
    hand = Hand(str(path), plant)
    datagram(path, data)
    hand.act(1.0)
    assert not plant.state[:, st.PUSH].any()
    hand.close()


def test_no_file_is_replaced_by_a_hand_and_a_hand_left_behind_is(path: Path) -> None:
    plant = load_machine("manutec-r15")
    path.write_text("mine")
    with pytest.raises(FileError, match=r"no socket can be made there: .* does not exist"):
        Hand(str(path), plant)
    assert path.read_text() == "mine"
    path.unlink()
    left = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    left.bind(str(path))
    left.close()
    Hand(str(path), plant).close()
    with pytest.raises(FileError, match="at most 100 bytes"):
        Hand(f"/tmp/{'x' * 200}", plant)  # noqa: S108 - none is made


def test_a_channel_takes_pushes_between_two_frames_and_lets_go_with_its_last_bus(
    path: Path,
) -> None:
    with can.Bus(interface="sim_plant", channel="manutec-r15", hand=str(path)) as bus:
        channel = _channels["manutec-r15"]
        assert channel._hand is not None
        pushed = channel._hand._state[:, st.PUSH]
        push(path, lasts=0.01)
        bus.send(SYNC)
        assert pushed.tolist() == PUSH
        for _ in range(4):
            bus.send(SYNC)
        assert not pushed.any()
        with pytest.raises(can.CanInitializationError, match="hand"):
            can.Bus(interface="sim_plant", channel="manutec-r15", hand=f"{path}2")
    assert not path.exists()
    with pytest.raises(can.CanInitializationError, match="no socket can be made"):
        can.Bus(interface="sim_plant", channel="manutec-r15", hand="/nowhere/hand")


def test_a_served_plant_takes_pushes_as_well(path: Path) -> None:
    plant, stop = load_machine("manutec-r15"), threading.Event()
    hand = Hand(str(path), plant)
    with (
        can.Bus("pushed", interface="virtual") as served,
        can.Bus("pushed", interface="virtual") as bus,
    ):
        server = threading.Thread(
            target=serve, args=(served, plant, "sync", stop), kwargs={"hand": hand}
        )
        server.start()
        push(path, lasts=0.5)
        bus.send(SYNC)
        while not plant.state[:, st.PUSH].any():
            assert server.is_alive()
        assert np.array_equal(plant.state[:, st.PUSH], PUSH)
        stop.set()
        server.join()
    hand.close()


@pytest.mark.parametrize("kind", [socket.SOCK_DGRAM, socket.SOCK_STREAM])
def test_a_socket_at_which_somebody_listens_is_not_replaced(
    path: Path, kind: socket.SocketKind
) -> None:
    plant = load_machine("manutec-r15")
    with socket.socket(socket.AF_UNIX, kind) as other:
        other.bind(str(path))
        if kind == socket.SOCK_STREAM:
            other.listen()
        with pytest.raises(FileError, match="no socket can be made there"):
            Hand(str(path), plant)
        assert path.is_socket()
