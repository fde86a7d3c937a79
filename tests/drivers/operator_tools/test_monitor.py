"""`hil drives monitor`: displayed values from listening alone; the monitor never sends."""

from __future__ import annotations

import io
import math
import struct
from typing import TYPE_CHECKING

import can
import pytest
from canopen_drive_bus import CanopenDriveBus
from probing_bench import drives_of
from rich.console import Console

from drivers.canopen.monitor import BusPicture
from drivers.cia402.states import State
from drivers.drive_bus import Move
from hil.cli.monitoring import _table, follow
from hil.terminal.keys import Keys

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.show.table import Table

OF_ONE = drives_of(1)


def frame(number: int, data: bytes = b"", timestamp: float = 0.0) -> can.Message:
    return can.Message(arbitration_id=number, data=data, is_extended_id=False, timestamp=timestamp)


@pytest.fixture
def picture() -> BusPicture:
    return BusPicture(drives_of(1, 3))


def test_beside_a_running_master_states_positions_and_rate_are_seen_without_a_frame_sent() -> None:
    drives = drives_of(1, 3)
    picture = BusPicture(drives)
    with (
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as listener,
        can.Bus("manutec-r15", "sim_plant", ignore_config=True) as master,
        CanopenDriveBus(master, drives) as axes,
    ):
        axes.move({1: Move(0.2, 1.0, 10.0)})
        while not (sample := axes.sample()).reached:
            pass
        listener.send = pytest.fail
        while (heard := listener.recv(0)) is not None:
            picture.take(heard, 1.0)
        assert picture.axes[1].state is State.OPERATION_ENABLED
        assert picture.axes[1].nmt == "operational"
        assert picture.axes[1].q == sample.q[1]
        assert picture.axes[1].tau == sample.tau[1]
        assert picture.sync_rate(1.0) == pytest.approx(250, rel=0.01)
        assert picture.sync_rate(9.0) == 0.0


def test_an_emergency_stays_until_the_drive_says_that_it_has_gone(picture: BusPicture) -> None:
    picture.take(frame(0x83, b"\x11\x86\x20" + bytes(5)), 1.0)
    assert "following error too large" in str(picture.axes[1].emergency)
    picture.take(frame(0x83, bytes(8)), 2.0)
    assert picture.axes[1].emergency is None
    assert picture.axes[1].emergencies == 1


def test_of_a_drive_that_says_nothing_nothing_is_shown(picture: BusPicture) -> None:
    axis = picture.axes[0]
    assert math.isnan(axis.q)
    assert axis.state is None
    assert math.isinf(axis.heard)
    assert picture.sync_rate(0.0) == 0.0


def test_a_tpdo_of_another_length_is_counted_and_not_guessed_at(picture: BusPicture) -> None:
    picture.take(frame(0x181, b"\x27\x06"), 1.0)
    assert (picture.axes[0].foreign, picture.axes[0].state) == (1, None)


def test_a_current_in_a_second_tpdo_is_understood() -> None:
    current = {"index": 0x30D1, "subindex": 2, "type": "i32", "basis": "mA", "amplitude": "peak"}
    picture = BusPicture(drives_of(1, current=current))
    picture.take(frame(0x281, struct.pack("<i", 1000)), 1.0)
    assert picture.axes[0].tau == pytest.approx(105 * 1.1616)


@pytest.mark.parametrize(
    "strange",
    [
        frame(0x700),
        frame(0x7FF, b"\x05"),
        frame(0x081),
        can.Message(arbitration_id=0x181, is_extended_id=True, data=bytes(8)),
        can.Message(arbitration_id=0x181, is_extended_id=False, is_remote_frame=True, dlc=8),
        can.Message(is_error_frame=True),
    ],
)
def test_frames_that_concern_nobody_change_nothing(
    picture: BusPicture, strange: can.Message
) -> None:
    before = [repr(axis) for axis in picture.axes]
    picture.take(strange, 1.0)
    assert [repr(axis) for axis in picture.axes] == before


# The table


class Typed(Keys):
    """Sequence of keys, one at each look."""

    def __init__(self, keys: str) -> None:
        super().__init__(io.StringIO())
        self._keys: Iterator[str] = iter(keys)

    def pressed(self) -> str:
        return next(self._keys, "q")


def followed(keys: str) -> tuple[list[int], str]:
    """Return the numbers of drawn tables while keys are typed, and the text of the terminal."""
    taken: list[int] = []
    console = Console(file=io.StringIO(), force_terminal=True, width=120)
    seen = BusPicture(OF_ONE)
    seen.sync_rate = lambda _: 250.0
    seen.take(frame(0x81, bytes.fromhex("1186000000000000")), 1.0)

    def draw() -> Table:
        taken.append(len(taken))
        return _table(seen, OF_ONE)

    follow(lambda _: None, draw, Typed(keys), console, None)
    return taken, console.file.getvalue()


def test_q_ends_the_table() -> None:
    taken, shown = followed("  q   ")
    assert len(taken) == 2
    assert "SYNC at 250 Hz" in shown
    assert "8611" in shown


def test_p_pauses_the_table_and_p_goes_on() -> None:
    taken, shown = followed(" p  p q")
    assert len(taken) == 3
    assert "paused" in shown


def test_without_a_terminal_the_table_is_printed_once_when_the_time_is_over() -> None:
    console = Console(file=io.StringIO(), width=120)
    seen = BusPicture(OF_ONE)
    follow(lambda _: None, lambda: _table(seen, OF_ONE), Typed(""), console, 0.01)
    shown = console.file.getvalue()
    assert shown.count(OF_ONE.axes[0].name) == 1
    assert "no SYNC" in shown
