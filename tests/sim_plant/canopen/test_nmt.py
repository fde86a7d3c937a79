"""NMT states and commands, boot-up, heartbeats both ways, emergencies of communication."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest

from sim_plant.canopen.abort_codes import AbortCode, SdoAbort
from sim_plant.drive.cia402_states import State
from sim_plant.slave_network import SlaveNetwork

if TYPE_CHECKING:
    import canopen
    from desk import Desk
    from ideal_machine import IdealMachine

START, STOP, PRE_OPERATIONAL, RESET_NODE, RESET_COMMUNICATION = 1, 2, 128, 129, 130
MASTER = 127
HEARTBEAT_LOST = 0x8130


def heartbeat(desk: Desk) -> None:
    desk.send(0x700 + MASTER, b"\x05")


def watch_master(desk: Desk, milliseconds: int = 20) -> None:
    desk.write(0x1016, MASTER << 16 | milliseconds, 1)
    heartbeat(desk)


def emergencies(desk: Desk, node: int = 1) -> list[int]:
    return [struct.unpack_from("<H", data)[0] for _, i, data in desk.log if i == 0x80 + node]


def moving(desk: Desk) -> None:
    desk.enable()
    desk.write(0x6081, 100_000)
    desk.write(0x607A, 500_000)
    desk.write(0x6040, 0x1F)
    desk.sync(10)
    assert desk.machine.axes[0].velocity > 0


# States


def test_power_on_sends_one_boot_up_of_every_node_in_order(ideal_machine: IdealMachine) -> None:
    frames = SlaveNetwork(ideal_machine).power_on()
    assert [(i, data) for _, i, data in frames] == [(0x700 + n, b"\0") for n in range(1, 7)]


def test_master_objects_see_boot_up_after_reset(master: canopen.Network) -> None:
    states: list[int] = []
    master[3].nmt.add_heartbeat_callback(states.append)
    master[3].nmt.state = "RESET"
    assert master[3].sdo[0x1017].raw == 0
    assert states == [0]
    assert master[3].nmt.state == "PRE-OPERATIONAL"


def test_the_heartbeat_reports_the_state_that_a_command_led_to(desk: Desk) -> None:
    desk.write(0x1017, 4)
    for command, state in ((START, 5), (STOP, 4), (PRE_OPERATIONAL, 127)):
        desk.nmt(command, 1)
        assert (0x701, bytes([state])) in desk.sync()


def test_a_command_to_another_node_changes_nothing(desk: Desk) -> None:
    desk.write(0x1017, 4)
    desk.nmt(START, 2)
    assert (0x701, b"\x7f") in desk.sync()


def test_a_stopped_node_answers_no_sdo_but_beats_on(desk: Desk) -> None:
    desk.write(0x1017, 4)
    desk.nmt(STOP, 1)
    assert desk.send(0x601, bytes([0x40, 0, 0x10, 0, 0, 0, 0, 0])) == []
    assert (0x701, b"\x04") in desk.sync()


def test_process_data_flow_only_while_operational(desk: Desk) -> None:
    desk.map_tpdo(1, 0x60410010)
    assert desk.sync() == []
    desk.nmt(START)
    assert [identifier for identifier, _ in desk.sync() if identifier == 0x181] == [0x181]
    desk.nmt(PRE_OPERATIONAL)
    assert desk.sync() == []


def test_reset_of_the_node_puts_everything_back(desk: Desk) -> None:
    desk.write(0x6081, 77)
    desk.write(0x1017, 500)
    desk.enable()
    desk.nmt(RESET_NODE, 1)
    assert (desk.read(0x6081), desk.read(0x1017)) == (4096, 0)
    assert desk.status() & 0x4F == State.SWITCH_ON_DISABLED
    assert not desk.machine.axes[0].enabled


def test_reset_of_communication_leaves_the_profile_alone(desk: Desk) -> None:
    desk.write(0x6081, 77)
    desk.write(0x1017, 500)
    assert (0x701, b"\0") in desk.nmt(RESET_COMMUNICATION, 1)
    assert (desk.read(0x6081), desk.read(0x1017)) == (77, 0)


def test_an_idle_drive_takes_stop_and_reset_without_fault(desk: Desk) -> None:
    desk.nmt(STOP)
    desk.nmt(RESET_COMMUNICATION)
    assert desk.status() & 0x4F == State.SWITCH_ON_DISABLED


def test_stopping_the_node_of_a_moving_axis_is_a_loss_of_communication(desk: Desk) -> None:
    moving(desk)
    desk.nmt(STOP, 1)
    desk.sync(500)
    desk.nmt(PRE_OPERATIONAL, 1)
    assert desk.status() & 0x4F == State.FAULT
    assert not desk.machine.axes[0].enabled


# Heartbeats


def test_the_producer_keeps_its_period_within_one_long_sync_cycle(desk: Desk) -> None:
    desk.write(0x1006, 100_000)
    desk.write(0x1017, 30)
    start = desk.network.time
    desk.sync()
    beats = [round(time - start, 6) for time, i, _ in desk.log if i == 0x701]
    assert beats == [0.03, 0.06, 0.09]


def test_a_consumer_waits_for_the_first_heartbeat(desk: Desk) -> None:
    desk.write(0x1016, MASTER << 16 | 20, 1)
    desk.sync(100)
    assert emergencies(desk) == []


def test_heartbeats_in_time_keep_a_drive_content(desk: Desk) -> None:
    watch_master(desk)
    desk.enable()
    for _ in range(20):
        desk.sync(4)
        heartbeat(desk)
    assert desk.status() & 0x6F == State.OPERATION_ENABLED


@pytest.mark.parametrize(
    ("option", "state", "call"),
    [
        (0, State.OPERATION_ENABLED, None),
        (1, State.FAULT, "stop"),
        (2, State.SWITCH_ON_DISABLED, "disable"),
        (3, State.SWITCH_ON_DISABLED, "stop"),
    ],
)
def test_loss_while_moving_leads_where_6007_says(
    desk: Desk, option: int, state: State, call: str | None
) -> None:
    desk.write(0x6007, option)
    watch_master(desk, 60)
    moving(desk)
    calls = desk.machine.axes[0].calls
    calls.clear()
    desk.sync(500)
    mask = 0x6F if state is State.OPERATION_ENABLED else 0x4F
    assert desk.status() & mask == state
    assert (calls[0][0] if calls else None) == call
    assert emergencies(desk)[0] == HEARTBEAT_LOST
    assert desk.read(0x1001) == 0x11
    assert desk.read(0x603F) == HEARTBEAT_LOST
    assert desk.read(0x1003, 1) == HEARTBEAT_LOST


def test_the_loss_is_noticed_at_its_own_instant(desk: Desk) -> None:
    watch_master(desk, 21)
    start = desk.network.time
    desk.write(0x1006, 100_000)
    desk.sync()
    assert [round(time - start, 6) for time, i, _ in desk.log if i == 0x81] == [0.021]


@pytest.mark.parametrize(("behaviour", "state"), [(0, 127), (1, 5), (2, 4)])
def test_loss_leads_to_the_nmt_state_that_1029_says(desk: Desk, behaviour: int, state: int) -> None:
    desk.write(0x1029, behaviour, 1)
    desk.write(0x1017, 100)
    watch_master(desk)
    desk.nmt(START, 1)
    assert (0x701, bytes([state])) in desk.sync(30)


def test_the_fault_of_a_lost_heartbeat_can_be_reset_only_when_it_is_back(desk: Desk) -> None:
    watch_master(desk, 100)
    desk.enable()
    desk.sync(200)
    desk.write(0x6040, 0x80)
    assert desk.status() & 0x4F == State.FAULT
    heartbeat(desk)
    assert desk.status() & 0x4F == State.FAULT
    desk.write(0x6040, 0)
    desk.write(0x6040, 0x80)
    assert desk.status() & 0x4F == State.SWITCH_ON_DISABLED
    assert emergencies(desk) == [HEARTBEAT_LOST, 0]
    assert desk.read(0x603F) == desk.read(0x1001) == 0


def test_an_idle_drive_recovers_by_itself_when_heartbeats_return(desk: Desk) -> None:
    watch_master(desk)
    desk.sync(10)
    heartbeat(desk)
    assert emergencies(desk) == [HEARTBEAT_LOST, 0]


# Emergencies


def test_the_history_keeps_the_newest_first_and_can_only_be_cleared(desk: Desk) -> None:
    watch_master(desk)
    desk.nmt(START, 1)
    desk.send(0x201, b"\0")
    desk.sync(10)
    assert desk.read(0x1003) == 2
    assert [desk.read(0x1003, n) for n in (1, 2)] == [HEARTBEAT_LOST, 0x8210]
    desk.write(0x1003, 0)
    assert desk.read(0x1003) == 0
    with pytest.raises(SdoAbort) as refused:
        desk.read(0x1003, 1)
    assert refused.value.code is AbortCode.NO_DATA


def test_1014_moves_and_switches_off_the_emergency_message(desk: Desk) -> None:
    desk.write(0x1014, 1 << 31 | 0x81)
    watch_master(desk)
    desk.sync(10)
    assert emergencies(desk) == []
    desk.write(0x1014, 0x91)
    heartbeat(desk)
    assert desk.log[-1][1] == 0x91


def test_canopens_emergency_consumer_understands_the_frames(master: canopen.Network) -> None:
    node = master[1]
    node.sdo[0x1016][1].raw = MASTER << 16 | 20
    master.send_message(0x700 + MASTER, b"\x05")
    for _ in range(10):
        master.sync.transmit()
    assert node.sdo[0x1001].raw == 0x11
    assert [(error.code, error.register) for error in node.emcy.active] == [(0x8130, 0x11)]
