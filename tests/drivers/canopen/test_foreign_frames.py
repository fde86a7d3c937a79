"""Frames of other masters and tools stop the axes; the first line states sender and command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import can
import pytest
from local_bench import all_off, build, never_energised

from drivers.drive_bus import DriveRefused, Move, NodeSilent, Tripped

if TYPE_CHECKING:
    from collections.abc import Callable

COMMANDS = [
    (0x000, "80 00", "another master commands all nodes to go pre-operational (NMT)"),
    (0x000, "02 02", "another master commands joint 2 (node 2) to stop (NMT)"),
    (0x000, "81 01", "another master commands joint 1 (node 1) to restart (NMT)"),
    (0x080, "", "another producer sends SYNC (080h)"),
    (0x202, "40 9c 00 00 1f 00", "another master commands joint 2 (node 2) by RPDO 202h"),
    (0x503, "00", "another master commands joint 3 (node 3) by RPDO 503h"),
    (
        0x602,
        "23 16 10 01 00 00 00 00",
        "another master or tool writes 1016:01 of joint 2 (node 2) = 0h (SDO)",
    ),
    (
        0x601,
        "2b 72 60 00 b8 0b 00 00",
        "another master or tool writes 6072:00 of joint 1 (node 1) = BB8h (SDO)",
    ),
    (0x603, "c6 00 14 01", "another master or tool writes 1400:01 of joint 3 (node 3) (SDO)"),
]
HARMLESS = [
    (0x000, "01 00", "another master commands all nodes to start"),
    (0x602, "40 64 60 00 00 00 00 00", "another master or tool reads objects of joint 2 (node 2)"),
]
NOT_OURS = [(0x000, "80 09"), (0x209, "00"), (0x609, "23 16 10 01 00 00 00 00"), (0x000, "02")]


def frame(identifier: int, data: str) -> can.Message:
    return can.Message(arbitration_id=identifier, data=bytes.fromhex(data), is_extended_id=False)


def sampled(drive_bus: Any, event: Callable[[], None]) -> None:
    """Sample once before an event and several times after the event."""
    drive_bus.sample()
    event()
    for _ in range(20):
        drive_bus.sample()


@pytest.mark.parametrize(("identifier", "data", "cause"), COMMANDS)
def test_a_foreign_command_stops_all_axes_and_is_the_reason(
    identifier: int, data: str, cause: str
) -> None:
    can_bus, drive_bus = build()
    with can_bus:
        with pytest.raises(Tripped) as caught, drive_bus:
            sampled(drive_bus, lambda: can_bus.inbox.append(frame(identifier, data)))
        assert all_off(can_bus)
    assert str(caught.value).startswith(cause)
    assert "stop the other master or tool first" in str(caught.value)


@pytest.mark.parametrize(("identifier", "data", "cause"), COMMANDS)
def test_a_foreign_command_before_power_on_is_refused(
    identifier: int, data: str, cause: str
) -> None:
    can_bus, drive_bus = build()
    foreign = [frame(identifier, data)]

    def joined(sent: can.Message) -> list[can.Message]:
        return [*foreign, sent] if sent.arbitration_id == 0x181 else [sent]

    can_bus.outgoing = joined
    with can_bus:
        with pytest.raises(DriveRefused) as caught, drive_bus:
            pytest.fail("the axes were powered on")
        assert never_energised(can_bus)
    assert str(caught.value).startswith(cause)


@pytest.mark.parametrize(("identifier", "data", "remark"), HARMLESS)
def test_what_only_reads_or_starts_is_noted_once(identifier: int, data: str, remark: str) -> None:
    can_bus, drive_bus = build()
    with can_bus, drive_bus:
        for _ in range(3):
            can_bus.inbox.append(frame(identifier, data))
            drive_bus.sample()
    assert [note.startswith(remark) for note in drive_bus.notes].count(True) == 1


@pytest.mark.parametrize(("identifier", "data"), NOT_OURS)
def test_other_nodes_are_not_our_business(identifier: int, data: str) -> None:
    can_bus, drive_bus = build()
    with can_bus, drive_bus:
        for _ in range(3):
            can_bus.inbox.append(frame(identifier, data))
            drive_bus.sample()
    assert not any("another" in note for note in drive_bus.notes)


def answers(*, size: int | None = None, twice: bool = False) -> str:
    """Return the error of a session in which the TPDO of node 2 is truncated or doubled."""
    can_bus, drive_bus = build()

    def spoilt(sent: can.Message) -> list[can.Message]:
        if sent.arbitration_id != 0x182:
            return [sent]
        other = can.Message(arbitration_id=0x182, data=sent.data[:size], is_extended_id=False)
        return [sent, other] if twice else [other]

    with can_bus:
        with pytest.raises((NodeSilent, Tripped)) as caught, drive_bus:
            sampled(drive_bus, lambda: setattr(can_bus, "outgoing", spoilt))
        assert all_off(can_bus)
    return str(caught.value)


def test_a_node_number_that_two_devices_have_is_named() -> None:
    message = answers(twice=True)
    assert message.startswith("joint 2 (node 2): two telegrams for each of 10 SYNCs in a row")
    assert "give each node its own number" in message


def test_a_tpdo_of_another_length_is_named() -> None:
    message = answers(size=2)
    assert "TPDO 182h has 2 bytes, 8 were mapped" in message
    assert "another master changed the mapping" in message


def unheard(event: Callable[[Any], None], moves: int = 40) -> str:
    """Return the error that ends a session of moves after a change that no frame shows."""
    can_bus, drive_bus = build()
    with can_bus:
        with pytest.raises(Tripped) as caught, drive_bus:  # noqa: PT012 - a session
            here = drive_bus.sample().q[0]
            event(can_bus.drives[2])
            for number in range(moves):
                drive_bus.move({0: Move(here + 0.01 * (number % 2), 0.5 + 0.1 * (number % 2), 2.0)})
                while not drive_bus.sample().reached:
                    pass
        assert all_off(can_bus)
    return str(caught.value)


def test_an_axis_that_a_tool_beside_the_bus_left_unwatched_does_not_move_again() -> None:
    message = unheard(lambda drive: drive.node.set_data(0x1016, 1, bytes(4)), moves=1)
    assert message.startswith("joint 2 (node 2): 1016:01 (consumer heartbeat time) is 0, ")
    assert f"{127 << 16 | 500} was written: another master or tool changed it" in message


@pytest.mark.parametrize("index", [0x6072, 0x607F, 0x6065])
def test_a_limit_that_a_tool_beside_the_bus_changes_is_read_back(index: int) -> None:
    def change(drive: Any) -> None:
        drive.node.set_data(
            index, 0, (60_000).to_bytes(len(drive.node.get_data(index, 0)), "little")
        )

    message = unheard(change)
    assert message.startswith(f"joint 2 (node 2): {index:04X}:00")
    assert "is 60000, " in message
