"""Session of canopen's independent master, over the plant's own bus and a stock one.

Nothing of the driver takes part. Where an answer comes from another thread, an SDO read after it
is the barrier: frames keep their order.
"""

from __future__ import annotations

import struct
import threading
from typing import TYPE_CHECKING

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from sim_plant.canopen.eds import EDS_PATH
from sim_plant.serving.server import serve

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ideal_machine import IdealMachine

NODES = range(1, 7)
LSS_MASTER, LSS_SLAVE, TIME, GUARD = 0x7E5, 0x7E4, 0x100, 0x700


@pytest.fixture(params=["sim_plant", "virtual"])
def master(
    request: pytest.FixtureRequest, ideal_channel: str, ideal_machine: IdealMachine
) -> Iterator[canopen.Network]:
    """Network of canopen with a remote node for each drive."""
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.02
    if request.param == "sim_plant":
        network.connect(interface="sim_plant", channel=ideal_channel)
        yield from _open_nodes(network)
        return
    stop = threading.Event()
    with can.Bus(interface="virtual", channel="foreign master") as plant_side:
        network.connect(interface="virtual", channel="foreign master")
        server = threading.Thread(target=serve, args=(plant_side, ideal_machine, "sync", stop))
        server.start()
        try:
            yield from _open_nodes(network)
        finally:
            stop.set()
            server.join()


def _open_nodes(network: canopen.Network) -> Iterator[canopen.Network]:
    for node_id in NODES:
        network.add_node(node_id, str(EDS_PATH))
    yield network
    network.disconnect()


@pytest.fixture
def patient_402(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let canopen's drive profile wait for a slow machine."""
    for name in (
        "RESET_FAULT",
        "SWITCH_OP_MODE",
        "SWITCH_STATE_FINAL",
        "SWITCH_STATE_SINGLE",
        "CHECK_TPDO",
    ):
        monkeypatch.setattr(BaseNode402, f"TIMEOUT_{name}", 30.0)


def sync(master: canopen.Network, count: int = 1) -> None:
    """Send SYNCs one by one and wait for the answers to each."""
    for _ in range(count):
        master.sync.transmit()
        barrier(master)


def barrier(master: canopen.Network) -> None:
    assert master[1].sdo[0x1000].raw == 0x00020192


def test_a_booting_master_finds_who_is_there_and_starts_them(master: canopen.Network) -> None:
    states: dict[int, list[int]] = {node: [] for node in NODES}
    for node in NODES:
        master[node].nmt.add_heartbeat_callback(states[node].append)
    master.nmt.send_command(130)
    for node in NODES:
        sdo = master[node].sdo
        assert sdo[0x1000].raw & 0xFFFF == 402
        assert sdo["Identity object"]["Vendor-ID"].raw == 0x1234
        assert [sdo[0x1018][n].raw for n in (2, 3, 4)] == [0x402, 7, 99 + node]
        assert sdo[0x1008].raw == "Simulated servo drive"
        sdo[0x1017].raw = 4
        with pytest.raises(canopen.SdoAbortedError, match="0x06020000"):
            sdo.upload(0x1F80, 0)
    master.nmt.state = "OPERATIONAL"
    sync(master, 3)
    for node in NODES:
        assert states[node][0] == 0
        assert states[node][-1] == 5
        assert master[node].nmt.state == "OPERATIONAL"


@pytest.mark.parametrize("length", [1, 7, 8, 500])
def test_text_goes_and_comes_in_segments_and_blocks(master: canopen.Network, length: int) -> None:
    sdo, text = master[2].sdo, bytes(33 + n % 90 for n in range(length))
    sdo.download(0x2000, 0, text, force_segment=True)
    assert sdo.upload(0x2000, 0) == text
    with sdo.open(0x2000, 0, "wb", size=length, block_transfer=True) as stream:
        stream.write(text[::-1])
    with sdo.open(0x2000, 0, "rb", block_transfer=True) as stream:
        assert stream.read() == text[::-1]


def test_an_sdo_abort_leaves_the_server_ready(master: canopen.Network) -> None:
    sdo = master[1].sdo
    for index, data, code in ((0x6041, b"\0\0", 0x06010002), (0x6040, b"\0", 0x06070013)):
        with pytest.raises(canopen.SdoAbortedError) as refused:
            sdo.download(index, 0, data)
        assert refused.value.code == code
    barrier(master)


def test_process_data_moves_an_axis_and_reports_it(
    master: canopen.Network, ideal_machine: IdealMachine
) -> None:
    node, positions = master[3], []
    node.tpdo.read()
    node.rpdo.read()
    tpdo, rpdo = node.tpdo[1], node.rpdo[1]
    for pdo, objects, kind in ((tpdo, (0x6041, 0x6064), 1), (rpdo, (0x607A, 0x6040), 255)):
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type, pdo.enabled = kind, True
        pdo.save()
    tpdo.add_callback(lambda pdo: positions.append(pdo[0x6064].raw))
    node.sdo[0x6081].raw, node.sdo[0x6083].raw, node.sdo[0x6084].raw = 50_000, 10**6, 10**6
    node.nmt.state = "OPERATIONAL"
    for word in (0x06, 0x07, 0x0F, 0x3F):
        rpdo[0x607A].raw, rpdo[0x6040].raw = 2000, word
        rpdo.transmit()
        sync(master)
    assert tpdo[0x6041].raw & 0x1000
    sync(master, 40)
    assert positions[-1] == 2000 == round(ideal_machine.axes[2].demand)
    assert positions == sorted(positions)
    assert tpdo[0x6041].raw & 0x0400
    assert not any(axis.enabled for n, axis in enumerate(ideal_machine.axes) if n != 2)


def test_an_event_driven_pdo_reports_changes_without_sync(master: canopen.Network) -> None:
    node, words = master[1], []
    node.tpdo.read()
    tpdo = node.tpdo[1]
    tpdo.clear()
    tpdo.add_variable(0x6041)
    tpdo.trans_type, tpdo.enabled = 255, True
    tpdo.save()
    tpdo.add_callback(lambda pdo: words.append(pdo[0x6041].raw & 0x6F))
    node.nmt.state = "OPERATIONAL"
    for word in (0x06, 0x07):
        node.sdo[0x6040].raw = word
        barrier(master)
    assert words[-2:] == [0x21, 0x23]


def test_emergencies_and_their_history_reach_the_master(master: canopen.Network) -> None:
    node = master[4]
    node.nmt.state = "OPERATIONAL"
    master.send_message(0x204, b"\0")
    barrier(master)
    assert [(error.code, error.register) for error in node.emcy.log] == [(0x8210, 0x11)]
    assert node.sdo[0x1003][1].raw == 0x8210
    node.sdo[0x1003][0].raw = 0
    assert node.sdo[0x1003][0].raw == 0


def test_canopens_drive_profile_enables_moves_and_switches_off(
    master: canopen.Network, ideal_machine: IdealMachine, patient_402: None
) -> None:
    node = BaseNode402(5, str(EDS_PATH))
    master.add_node(node)
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.op_mode = "PROFILED POSITION"
    assert node.is_op_mode_supported("PROFILED POSITION")
    assert not node.is_op_mode_supported("PROFILED TORQUE")
    for state in ("SWITCH ON DISABLED", "READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
        node.state = state
        assert node.state == state
    assert ideal_machine.axes[4].enabled
    node.sdo[0x607A].raw = 300
    node.sdo[0x6081].raw, node.sdo[0x6083].raw, node.sdo[0x6084].raw = 50_000, 10**6, 10**6
    node.sdo[0x6040].raw = 0x1F
    sync(master, 30)
    assert node.sdo[0x6064].raw == 300
    node.state = "SWITCH ON DISABLED"
    assert not ideal_machine.axes[4].enabled
    assert not node.is_faulted()


def test_a_lost_heartbeat_of_the_master_is_a_fault_that_it_can_reset(
    master: canopen.Network, patient_402: None
) -> None:
    node = BaseNode402(1, str(EDS_PATH))
    master.add_node(node)
    node.nmt.state = "PRE-OPERATIONAL"
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.sdo[0x1016][1].raw = 127 << 16 | 20
    node.sdo[0x6007].raw = 1
    master.send_message(0x77F, b"\x05")
    node.state = "OPERATION ENABLED"
    sync(master, 10)
    assert node.is_faulted()
    assert [error.code for error in node.emcy.active] == [0x8130]
    assert node.sdo[0x1001].raw == 0x11  # pre-operational by now: SDO only
    master.send_message(0x77F, b"\x05")
    node.nmt.state = "OPERATIONAL"
    for word in (0x00, 0x80):  # its own reset_from_fault waits for a TPDO triggered by SYNC
        node.controlword = word
    sync(master)
    assert not node.is_faulted()
    assert node.state == "SWITCH ON DISABLED"


def test_what_other_masters_say_besides_is_tolerated(master: canopen.Network) -> None:
    heard: list[int] = []
    for identifier in (LSS_SLAVE, LSS_MASTER, TIME, *(GUARD + node for node in NODES)):
        master.subscribe(identifier, lambda can_id, *_: heard.append(can_id))
    for command in (0x04, 0x40, 0x4B, 0x51, 0x5E):  # switch state, inquire, fast scan
        master.send_message(LSS_MASTER, bytes([command, *bytes(7)]))
    master.send_message(LSS_MASTER, struct.pack("<BIBBB", 0x51, 0, 0x80, 0, 0))
    master.send_message(TIME, struct.pack("<IH", 3_600_000, 15_000))
    for node in NODES:
        master.send_message(GUARD + node, b"", remote=True)
    for counter in (1, 2, 240):
        master.send_message(0x80, bytes([counter]))
    master.send_message(0x000, b"\x01\x7f")
    barrier(master)
    assert heard == []
    assert [master[node].emcy.log for node in NODES] == [[]] * 6


def test_a_synchronous_pdo_answers_a_sync_with_counter(master: canopen.Network) -> None:
    node, received = master[1], []
    node.tpdo.read()
    node.tpdo[1].trans_type, node.tpdo[1].enabled = 1, True
    node.tpdo[1].save()
    node.tpdo[1].add_callback(received.append)
    node.nmt.state = "OPERATIONAL"
    for counter in (1, 2, 3):
        master.sync.transmit(counter)
    barrier(master)
    assert len(received) == 3
