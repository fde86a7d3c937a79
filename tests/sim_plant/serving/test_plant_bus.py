"""The plant as a python-can interface, shared channels, and the plant on another bus."""

from __future__ import annotations

import itertools
import struct
import sys
import threading
import time
from typing import TYPE_CHECKING

import can
import canopen
import pytest
from typer.testing import CliRunner

from sim_plant import __main__ as command
from sim_plant.canopen.eds import EDS_PATH
from sim_plant.plant_file import packaged_plants
from sim_plant.serving.bus import PlantBus
from sim_plant.serving.server import serve

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ideal_machine import IdealMachine

SYNC = can.Message(arbitration_id=0x80, is_extended_id=False)
READ_TYPE = bytes([0x40, 0x00, 0x10, 0, 0, 0, 0, 0])
BOOT_UPS = [0x700 + n for n in range(1, 7)]


def drain(bus: can.BusABC) -> list[can.Message]:
    messages = []
    while (message := bus.recv(0)) is not None:
        messages.append(message)
    return messages


def request(node: int = 1) -> can.Message:
    return can.Message(arbitration_id=0x600 + node, data=READ_TYPE, is_extended_id=False)


@pytest.fixture
def bus(ideal_channel: str) -> Iterator[can.BusABC]:
    with can.Bus(interface="sim_plant", channel=ideal_channel) as opened:
        drain(opened)
        yield opened


def test_the_interface_is_found_by_its_name(bus: can.BusABC) -> None:
    assert isinstance(bus, PlantBus)
    assert bus.lock_step is True
    assert bus.state is can.BusState.ACTIVE
    assert "ideal" in str(bus)


def test_opening_switches_the_drives_on(ideal_channel: str) -> None:
    with can.Bus(interface="sim_plant", channel=ideal_channel) as bus:
        assert [message.arbitration_id for message in drain(bus)] == BOOT_UPS


def test_answers_are_there_when_send_returns(bus: can.BusABC) -> None:
    bus.send(request(3))
    answer = bus.recv(0)
    assert answer is not None
    assert (answer.arbitration_id, answer.dlc, answer.is_rx) == (0x583, 8, True)
    assert answer.data[:4] == bytes([0x43, 0x00, 0x10, 0])
    assert bus.recv(0) is None


def test_an_interrupt_at_any_moment_of_a_frame_leaves_the_channel_usable(
    bus: can.BusABC,
) -> None:
    for moment in itertools.count():
        if not interrupted_while_sending(bus, moment):
            break
        # in a thread: a lock left behind would block the test forever
        later = threading.Thread(target=bus.send, args=(SYNC,), daemon=True)
        later.start()
        later.join(10)
        assert not later.is_alive(), f"no frame goes out after an interrupt at moment {moment}"
    assert moment > 10


def interrupted_while_sending(bus: can.BusABC, moment: int) -> bool:
    """Send a SYNC with an interrupt after this number of calls;
    return False if there were fewer.
    """
    left = moment

    def count(_frame: object, event: str, _argument: object) -> None:
        nonlocal left
        if event in {"return", "c_return"}:
            left -= 1
            if left < 0:
                sys.setprofile(None)
                raise KeyboardInterrupt

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        bus.send(SYNC)
    except KeyboardInterrupt:
        return True
    finally:
        sys.setprofile(before)
    return False


def test_time_stamps_are_the_plants_time_and_leave_room_for_bits(bus: can.BusABC) -> None:
    for _ in range(250):
        bus.send(SYNC)
    bus.send(can.Message(arbitration_id=0, data=[129, 0], is_extended_id=False))
    stamps = [message.timestamp for message in drain(bus)]
    assert stamps[0] == pytest.approx(1.0, abs=0.001)
    assert all(
        later - earlier == pytest.approx(55e-6) for earlier, later in itertools.pairwise(stamps)
    )


def test_a_logger_beside_a_master_sees_both_sides(bus: can.BusABC, ideal_channel: str) -> None:
    with can.Bus(interface="sim_plant", channel=ideal_channel) as monitor:
        bus.send(request())
        assert [m.arbitration_id for m in drain(monitor)] == [0x601, 0x581]
        assert [m.arbitration_id for m in drain(bus)] == [0x581]
        monitor.send(request(2))
        assert [m.arbitration_id for m in drain(bus)] == [0x602, 0x582]


def test_own_frames_come_back_only_on_request(ideal_channel: str) -> None:
    with can.Bus(interface="sim_plant", channel=ideal_channel, receive_own_messages=True) as bus:
        drain(bus)
        bus.send(request())
        own, answer = drain(bus)
        assert (own.arbitration_id, own.is_rx) == (0x601, False)
        assert answer.arbitration_id == 0x581


def test_filters_hold(bus: can.BusABC) -> None:
    bus.set_filters([{"can_id": 0x582, "can_mask": 0x7FF}])
    bus.send(request(1))
    bus.send(request(2))
    assert [m.arbitration_id for m in drain(bus)] == [0x582]


def test_recv_waits_no_longer_than_its_timeout(bus: can.BusABC) -> None:
    begin = time.monotonic()
    assert bus.recv(0.05) is None
    assert 0.04 < time.monotonic() - begin < 30.0  # patient with a busy machine, but bounded


def test_recv_wakes_up_when_another_thread_sends(bus: can.BusABC) -> None:
    threading.Timer(0.05, bus.send, args=[request()]).start()
    message = bus.recv(5.0)
    assert message is not None
    assert message.arbitration_id == 0x581


def test_many_threads_may_send(bus: can.BusABC) -> None:
    def ask() -> None:
        for _ in range(200):
            bus.send(request())

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(drain(bus)) == 800


def test_frames_that_are_not_for_drives_are_ignored(bus: can.BusABC) -> None:
    bus.send(can.Message(arbitration_id=0x601, data=READ_TYPE, is_extended_id=True))
    bus.send(can.Message(arbitration_id=0x601, is_remote_frame=True, is_extended_id=False, dlc=8))
    bus.send(can.Message(is_error_frame=True))
    assert drain(bus) == []


def test_can_fd_is_refused(bus: can.BusABC) -> None:
    with pytest.raises(can.CanOperationError, match="FD"):
        bus.send(can.Message(arbitration_id=1, is_fd=True, is_extended_id=False))


def test_a_bus_that_is_shut_down_can_neither_send_nor_receive(ideal_channel: str) -> None:
    bus = can.Bus(interface="sim_plant", channel=ideal_channel)
    bus.shutdown()
    bus.shutdown()
    with pytest.raises(can.CanOperationError, match="shut down"):
        bus.send(SYNC)
    with pytest.raises(can.CanOperationError, match="shut down"):
        bus.recv(0)


def test_the_last_bus_to_leave_switches_the_plant_off(ideal_channel: str) -> None:
    first = can.Bus(interface="sim_plant", channel=ideal_channel)
    second = can.Bus(interface="sim_plant", channel=ideal_channel)
    first.shutdown()
    assert drain(second) == []
    second.shutdown()
    with can.Bus(interface="sim_plant", channel=ideal_channel) as third:
        assert [m.arbitration_id for m in drain(third)] == BOOT_UPS


def test_an_unknown_channel_is_refused_with_the_known_ones() -> None:
    with pytest.raises(can.CanInitializationError, match=r"no-such.*manutec-r15"):
        can.Bus(interface="sim_plant", channel="no-such")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": "x"}, "seed='x'"),
        ({"seed": -1}, "seed=-1"),
        ({"cycle": "0"}, "cycle='0'"),
        ({"colour": "red"}, "colour: unknown option of the simulated plant"),
        ({"clock": "sundial"}, "sync, wall"),
        ({"bitrate": 0}, "bitrate=0"),
    ],
)
def test_an_option_without_meaning_is_refused(
    ideal_channel: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(can.CanInitializationError, match=message):
        PlantBus(ideal_channel, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("options", [{"seed": 2}, {"clock": "wall"}, {"cycle": 1}])
def test_a_channel_cannot_be_joined_with_other_options(
    ideal_channel: str, options: dict[str, object]
) -> None:
    with (
        PlantBus(ideal_channel, seed="1"),
        pytest.raises(can.CanInitializationError, match="is open in this process"),
    ):
        PlantBus(ideal_channel, **options)  # type: ignore[arg-type]


def test_packaged_plants_are_detected() -> None:
    configs = can.detect_available_configs(interfaces=["sim_plant"])
    assert [config["channel"] for config in configs] == packaged_plants()


def test_on_the_wall_clock_heartbeats_come_by_themselves(ideal_channel: str) -> None:
    with PlantBus(ideal_channel, clock="wall") as bus:
        assert bus.lock_step is False
        drain(bus)
        bus.send(
            can.Message(
                arbitration_id=0x601,
                data=[0x2B, 0x17, 0x10, 0, 20, 0, 0, 0],
                is_extended_id=False,
            )
        )
        beats = [bus.recv(5.0) for _ in range(4)][1:]
        assert [beat.arbitration_id for beat in beats if beat is not None] == [0x701] * 3


# The plant on another bus


@pytest.mark.parametrize("clock", ["sync", "wall"])
def test_canopens_master_works_with_the_plant_on_a_stock_virtual_bus(
    ideal_machine: IdealMachine, clock: str
) -> None:
    channel = f"served-{clock}"
    stop = threading.Event()
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    with can.Bus(interface="virtual", channel=channel) as plant_side:
        network.connect(interface="virtual", channel=channel)
        node = network.add_node(1, str(EDS_PATH))
        server = threading.Thread(target=serve, args=(plant_side, ideal_machine, clock, stop))
        server.start()
        try:
            for controlword in (6, 7, 15):
                node.sdo[0x6040].raw = controlword
            assert node.sdo[0x6041].raw & 0x6F == 0x27
            assert ideal_machine.axes[0].enabled
        finally:
            stop.set()
            server.join()
            network.disconnect()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--plant", "no-such"], "no-such"),
        (["--interface", "no-such"], "no-such"),
        (["--clock", "sundial"], "sync, wall"),
        (["--bus-option", "bitrate"], "key=value"),
    ],
)
def test_the_command_states_what_is_wrong_in_one_line(arguments: list[str], message: str) -> None:
    result = CliRunner().invoke(
        command.app, ["--interface", "virtual", "--channel", "x", *arguments]
    )
    assert result.exit_code == 1
    assert message in result.output
    assert result.output.count("\n") == 1


def test_the_command_says_that_it_simulates_and_ends_on_ctrl_c(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_args: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "serve", interrupted)
    result = CliRunner().invoke(command.app, ["--interface", "virtual", "--channel", "x"])
    assert result.exit_code == 0
    assert "Simulated plant manutec-r15" in result.output
    assert "no real machine moves" in result.output


def test_drives_are_given_a_personality_by_option() -> None:
    with PlantBus("manutec-r15", personality="torque-only") as bus:
        assert read_object(bus, 3, 0x6078) is None
        assert read_object(bus, 3, 0x6077) is not None


@pytest.mark.parametrize(("option", "what"), [("personality", "grumpy"), ("faults", "none.yaml")])
def test_an_unknown_personality_or_fault_plan_is_refused(option: str, what: str) -> None:
    with pytest.raises(can.CanInitializationError, match=what):
        PlantBus("manutec-r15", **{option: what})


def test_a_fault_plan_goes_wrong_on_the_bus(tmp_path: Path) -> None:
    plan = tmp_path / "faults.yaml"
    plan.write_text("faults:\n  - {what: sdo-silent, axis: 2, at: {time: 0}}\n")
    with PlantBus("manutec-r15", faults=str(plan)) as bus:
        assert read_object(bus, 1, 0x1000) is not None
        with pytest.raises(TimeoutError):
            read_object(bus, 2, 0x1000)


def read_object(bus: PlantBus, node: int, index: int) -> bytes | None:
    """Upload an object by SDO; return None if it is missing."""
    request = struct.pack("<BHB4x", 0x40, index, 0)
    bus.send(can.Message(arbitration_id=0x600 + node, data=request, is_extended_id=False))
    while (frame := bus.recv(0)) is not None:
        if frame.arbitration_id == 0x580 + node:
            return None if frame.data[0] == 0x80 else bytes(frame.data[4:])
    raise TimeoutError
