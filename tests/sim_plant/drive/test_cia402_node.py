"""Power state machine, option codes, faults and profile position of one drive."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import pytest

from sim_plant.machine_protocol import AxisEvent

if TYPE_CHECKING:
    import canopen
    from desk import Desk
    from ideal_machine import IdealAxis

# Names and patterns from the standard, independent of the drive's own tables.
PATTERNS = {
    "not ready to switch on": (0x4F, 0x00),
    "switch on disabled": (0x4F, 0x40),
    "ready to switch on": (0x6F, 0x21),
    "switched on": (0x6F, 0x23),
    "operation enabled": (0x6F, 0x27),
    "quick stop active": (0x6F, 0x07),
    "fault reaction active": (0x4F, 0x0F),
    "fault": (0x4F, 0x08),
}
SHUTDOWN, SWITCH_ON, ENABLE, DISABLE_VOLTAGE, QUICK_STOP = 0x06, 0x07, 0x0F, 0x00, 0x02
NEW, IMMEDIATE, RELATIVE, HALT, RESET = 0x10, 0x20, 0x40, 0x100, 0x80
REACHED, LIMIT, ACKNOWLEDGE, FOLLOWING, WARNING = 0x400, 0x800, 0x1000, 0x2000, 0x80

WAYS = {
    "switch on disabled": (),
    "ready to switch on": (SHUTDOWN,),
    "switched on": (SHUTDOWN, SWITCH_ON),
    "operation enabled": (SHUTDOWN, SWITCH_ON, ENABLE),
    "quick stop active": (SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP),
}
EXPECTED = {
    # from: shutdown, switch on, enable operation, disable voltage, quick stop
    "switch on disabled": (
        "ready to switch on",
        "switch on disabled",
        "switch on disabled",
        "switch on disabled",
        "switch on disabled",
    ),
    "ready to switch on": (
        "ready to switch on",
        "switched on",
        "operation enabled",
        "switch on disabled",
        "switch on disabled",
    ),
    "switched on": (
        "ready to switch on",
        "switched on",
        "operation enabled",
        "switch on disabled",
        "switch on disabled",
    ),
    "operation enabled": (
        "ready to switch on",
        "switched on",
        "operation enabled",
        "switch on disabled",
        "quick stop active",
    ),
    "quick stop active": (
        "quick stop active",
        "quick stop active",
        "operation enabled",
        "switch on disabled",
        "quick stop active",
    ),
}
COMMANDS = (SHUTDOWN, SWITCH_ON, ENABLE, DISABLE_VOLTAGE, QUICK_STOP)


def state(desk: Desk) -> str:
    found = [name for name, (mask, value) in PATTERNS.items() if desk.status() & mask == value]
    assert len(found) == 1
    return found[0]


def axis(desk: Desk) -> IdealAxis:
    return desk.machine.axes[0]


def control(desk: Desk, controlword: int) -> None:
    desk.write(0x6040, controlword)


def set_point(desk: Desk, target: int, bits: int = 0, velocity: int = 100_000) -> None:
    """Send a set-point with a rising edge of bit 4, then clear the bit."""
    desk.write(0x6081, velocity)
    desk.write(0x607A, target)
    control(desk, ENABLE | NEW | bits)
    control(desk, ENABLE | bits)


def emergencies(desk: Desk) -> list[int]:
    return [struct.unpack_from("<H", data)[0] for _, i, data in desk.log if i == 0x81]


def moving(desk: Desk, target: int = 500_000) -> None:
    desk.enable()
    set_point(desk, target)
    desk.sync(10)
    assert axis(desk).velocity != 0
    axis(desk).calls.clear()


# Power states


@pytest.mark.parametrize("start", WAYS)
@pytest.mark.parametrize("number", range(5))
def test_every_command_leads_where_the_standard_says(desk: Desk, start: str, number: int) -> None:
    desk.write(0x605A, 6)
    for controlword in WAYS[start]:
        control(desk, controlword)
    desk.sync(2)
    assert state(desk) == start
    control(desk, COMMANDS[number])
    desk.sync(2)
    assert state(desk) == EXPECTED[start][number]
    powered = state(desk) in ("operation enabled", "quick stop active")
    assert axis(desk).enabled == powered


def test_a_drive_begins_disabled_with_voltage_and_remote(desk: Desk) -> None:
    assert desk.status() == 0x0250


@pytest.mark.parametrize(
    ("code", "after", "calls"),
    [
        (0, "switch on disabled", ["disable"]),
        (1, "switch on disabled", ["stop", "disable"]),
        (2, "switch on disabled", ["stop", "disable"]),
        (3, "switch on disabled", ["hold", "disable"]),
        (5, "quick stop active", ["stop"]),
        (6, "quick stop active", ["stop"]),
        (7, "quick stop active", ["hold"]),
    ],
)
def test_quick_stop_follows_605a(desk: Desk, code: int, after: str, calls: list[str]) -> None:
    desk.write(0x605A, code)
    desk.write(0x6084, 111_000)
    desk.write(0x6085, 222_000)
    moving(desk)
    control(desk, QUICK_STOP)
    if code in (1, 2, 5, 6):
        assert state(desk) == "quick stop active"
        assert axis(desk).calls[0] == ("stop", 222_000 if code in (2, 6) else 111_000)
    desk.sync(500)
    assert state(desk) == after
    assert [call[0] for call in axis(desk).calls] == calls
    assert axis(desk).velocity == 0


def test_quick_stop_active_is_left_for_operation_without_moving_on(desk: Desk) -> None:
    desk.write(0x605A, 6)
    moving(desk)
    control(desk, QUICK_STOP)
    desk.sync(500)
    rest = desk.read(0x6064)
    assert desk.status() & REACHED
    control(desk, ENABLE)
    desk.sync(100)
    assert state(desk) == "operation enabled"
    assert desk.read(0x6064) == rest


def test_a_quick_stop_that_ends_in_power_off_cannot_be_taken_back(desk: Desk) -> None:
    moving(desk)
    control(desk, QUICK_STOP)
    control(desk, ENABLE)
    desk.sync(500)
    assert state(desk) == "switch on disabled"


@pytest.mark.parametrize(
    ("index", "controlword", "after"),
    [(0x605B, SHUTDOWN, "ready to switch on"), (0x605C, SWITCH_ON, "switched on")],
)
@pytest.mark.parametrize(("code", "calls"), [(0, ["disable"]), (1, ["stop", "disable"])])
def test_leaving_operation_follows_605b_and_605c(
    desk: Desk, index: int, controlword: int, after: str, code: int, calls: list[str]
) -> None:
    desk.write(index, code)
    moving(desk)
    control(desk, controlword)
    assert state(desk) == (after if code == 0 else "operation enabled")
    desk.sync(500)
    assert state(desk) == after
    assert [call[0] for call in axis(desk).calls] == calls


def test_a_slow_down_can_be_taken_back(desk: Desk) -> None:
    moving(desk)
    control(desk, SWITCH_ON)
    control(desk, ENABLE)
    desk.sync(500)
    assert state(desk) == "operation enabled"
    assert desk.status() & REACHED
    rest = desk.read(0x6064)
    set_point(desk, 100, RELATIVE)
    desk.sync(500)
    assert desk.read(0x6064) == rest + 100


def test_disable_voltage_cuts_the_torque_at_once(desk: Desk) -> None:
    moving(desk)
    control(desk, DISABLE_VOLTAGE)
    assert axis(desk).calls == [("disable",)]
    assert state(desk) == "switch on disabled"


# Faults


def follow_badly(desk: Desk) -> None:
    axis(desk).forced = AxisEvent.FOLLOWING_ERROR
    desk.sync()
    axis(desk).forced = AxisEvent(0)


@pytest.mark.parametrize(
    ("code", "calls"),
    [
        (0, ["disable"]),
        (1, ["stop", "disable"]),
        (2, ["stop", "disable"]),
        (3, ["hold", "disable"]),
    ],
)
def test_the_fault_reaction_follows_605e(desk: Desk, code: int, calls: list[str]) -> None:
    desk.write(0x605E, code)
    desk.write(0x6085, 409_600)  # slow enough to be seen
    moving(desk)
    follow_badly(desk)
    if code in (1, 2):
        assert state(desk) == "fault reaction active"
    desk.sync(500)
    assert state(desk) == "fault"
    assert [call[0] for call in axis(desk).calls] == calls


def test_a_following_error_is_reported_in_every_place(desk: Desk) -> None:
    moving(desk)
    axis(desk).forced = AxisEvent.FOLLOWING_ERROR
    desk.sync()
    assert desk.status() & FOLLOWING
    assert emergencies(desk) == [0x8611]
    assert (desk.read(0x603F), desk.read(0x1001), desk.read(0x1003, 1)) == (0x8611, 0x21, 0x8611)


@pytest.mark.parametrize("controlword", COMMANDS)
def test_no_command_leaves_fault(desk: Desk, controlword: int) -> None:
    moving(desk)
    follow_badly(desk)
    desk.sync(500)
    control(desk, controlword)
    assert state(desk) == "fault"


def test_only_a_rising_edge_of_bit_7_resets_a_fault(desk: Desk) -> None:
    desk.enable()
    control(desk, ENABLE | RESET)
    follow_badly(desk)
    desk.sync(10)
    control(desk, ENABLE | RESET)
    assert state(desk) == "fault"
    control(desk, 0)
    control(desk, RESET)
    assert state(desk) == "switch on disabled"
    assert emergencies(desk) == [0x8611, 0]
    assert not axis(desk).enabled


def test_the_following_window_reaches_the_axis_in_its_units(desk: Desk) -> None:
    desk.write(0x6065, 1000)
    desk.write(0x6066, 30)
    assert axis(desk).calls[-1] == ("window", 1000.0, 0.03)
    desk.write(0x6065, 0xFFFF_FFFF)
    assert axis(desk).calls[-1] == ("window", float("inf"), 0.03)


def test_the_smaller_of_torque_and_current_limit_reaches_the_axis(desk: Desk) -> None:
    desk.write(0x6072, 900)
    desk.write(0x6073, 800)
    desk.write(0x6072, 700)
    assert [call for call in axis(desk).calls if call[0] == "torque"][-3:] == [
        ("torque", 900),
        ("torque", 800),
        ("torque", 700),
    ]


def test_saturation_shows_as_internal_limit_while_it_lasts(desk: Desk) -> None:
    desk.enable()
    axis(desk).forced = AxisEvent.SATURATED
    desk.sync()
    assert desk.status() & LIMIT
    axis(desk).forced = AxisEvent(0)
    desk.sync()
    assert not desk.status() & LIMIT


# Set-points


def test_the_handshake_goes_edge_acknowledge_release(desk: Desk) -> None:
    desk.enable()
    desk.sync(3)
    assert desk.status() & (REACHED | ACKNOWLEDGE) == REACHED
    desk.write(0x607A, 10_000)
    control(desk, ENABLE | NEW)
    assert desk.status() & (REACHED | ACKNOWLEDGE) == ACKNOWLEDGE
    control(desk, ENABLE)
    assert not desk.status() & ACKNOWLEDGE
    desk.sync(2000)
    assert desk.status() & REACHED
    assert desk.read(0x6064) == 10_000


def test_a_level_of_bit_4_is_no_new_set_point(desk: Desk) -> None:
    desk.enable()
    desk.write(0x607A, 100)
    control(desk, ENABLE | NEW)
    desk.write(0x607A, 200)
    control(desk, ENABLE | NEW)
    desk.sync(500)
    assert desk.read(0x6064) == 100


def test_a_set_point_before_operation_is_enabled_moves_nothing(desk: Desk) -> None:
    desk.write(0x607A, 100)
    for controlword in (SHUTDOWN | NEW, SWITCH_ON | NEW):
        control(desk, controlword)
    desk.sync(10)
    assert not any(call[0] == "move" for call in axis(desk).calls)


@pytest.mark.parametrize("before", [SHUTDOWN, SWITCH_ON])
def test_a_set_point_in_the_word_that_enables_operation_moves_nothing(
    desk: Desk, before: int
) -> None:
    for controlword in (SHUTDOWN, before, ENABLE | NEW | IMMEDIATE, ENABLE | NEW):
        desk.write(0x607A, 100_000)
        control(desk, controlword)
    desk.sync(20)
    assert axis(desk).velocity == 0
    control(desk, ENABLE)
    set_point(desk, 100_000)
    desk.sync(20)
    assert axis(desk).velocity > 0


def test_a_set_point_of_zero_length_is_reached(desk: Desk) -> None:
    desk.enable()
    desk.sync(5)
    set_point(desk, 0)
    assert not desk.status() & REACHED
    desk.sync(5)
    assert desk.status() & REACHED


def test_the_values_count_that_stood_at_the_edge(desk: Desk) -> None:
    desk.write(0x6083, 300_000)
    desk.write(0x6084, 200_000)
    desk.enable()
    set_point(desk, 40_000, velocity=20_000)
    desk.write(0x6081, 99)
    desk.write(0x607A, 7)
    assert axis(desk).calls[-1] == ("move", 40_000, 20_000, 300_000, 200_000)


def test_a_second_set_point_waits_in_the_buffer_until_the_first_is_reached(desk: Desk) -> None:
    moving(desk, 30_000)
    set_point(desk, 10_000)
    assert desk.status() & ACKNOWLEDGE
    assert axis(desk).calls == []
    while desk.status() & ACKNOWLEDGE:
        desk.sync()
        assert not desk.status() & REACHED
    assert axis(desk).demand == pytest.approx(30_000, abs=500)
    assert axis(desk).calls[-1][:2] == ("move", 10_000)
    desk.sync(1000)
    assert desk.read(0x6064) == 10_000
    assert desk.status() & REACHED


def test_a_third_set_point_is_not_taken_while_the_buffer_is_full(desk: Desk) -> None:
    moving(desk, 30_000)
    set_point(desk, 20_000)
    set_point(desk, 99_000)
    desk.sync(2000)
    assert desk.read(0x6064) == 20_000


def test_change_immediately_replaces_the_present_set_point_and_the_buffer(desk: Desk) -> None:
    moving(desk, 400_000)
    set_point(desk, 390_000)
    set_point(desk, -5_000, IMMEDIATE)
    assert axis(desk).calls == [("move", -5_000, 100_000, 40_960, 40_960)]
    assert not desk.status() & ACKNOWLEDGE
    desk.sync(5000)
    assert desk.read(0x6064) == -5_000


def test_relative_set_points_count_from_the_preceding_target(desk: Desk) -> None:
    desk.enable()
    set_point(desk, 1000, RELATIVE)
    desk.sync(500)
    set_point(desk, -300, RELATIVE)
    set_point(desk, -300, RELATIVE | IMMEDIATE)
    desk.sync(500)
    assert desk.read(0x6064) == 400


def test_halt_interrupts_and_its_release_goes_on(desk: Desk) -> None:
    moving(desk, 50_000)
    control(desk, ENABLE | HALT)
    assert axis(desk).calls == [("stop", 40_960)]
    assert not desk.status() & REACHED
    desk.sync(1000)
    halted_at = desk.read(0x6064)
    assert 0 < halted_at < 50_000
    assert desk.status() & REACHED
    control(desk, ENABLE)
    assert not desk.status() & REACHED
    desk.sync(2000)
    assert desk.read(0x6064) == 50_000


@pytest.mark.parametrize(
    ("code", "call"), [(1, ("stop", 11_000)), (2, ("stop", 22_000)), (3, ("hold",))]
)
def test_halt_follows_605d(desk: Desk, code: int, call: tuple[object, ...]) -> None:
    desk.write(0x605D, code)
    desk.write(0x6084, 11_000)
    desk.write(0x6085, 22_000)
    moving(desk)
    control(desk, ENABLE | HALT)
    assert axis(desk).calls == [call]


def test_a_set_point_given_while_halted_begins_at_the_release(desk: Desk) -> None:
    desk.enable()
    control(desk, ENABLE | HALT)
    set_point(desk, 700, HALT)
    desk.sync(50)
    assert desk.read(0x6064) == 0
    control(desk, ENABLE)
    desk.sync(500)
    assert desk.read(0x6064) == 700


def test_a_new_set_point_with_the_release_of_halt_replaces_the_old_one(desk: Desk) -> None:
    moving(desk, 50_000)
    control(desk, ENABLE | HALT)
    desk.sync(1000)
    axis(desk).calls.clear()
    set_point(desk, 0, IMMEDIATE)
    assert axis(desk).calls == [("move", 0, 100_000, 40_960, 40_960)]


def test_power_off_forgets_set_points(desk: Desk) -> None:
    moving(desk, 50_000)
    control(desk, DISABLE_VOLTAGE)
    desk.enable()
    axis(desk).calls.clear()
    desk.sync(100)
    assert axis(desk).calls == []


# Target window


def test_target_reached_waits_for_the_window_and_its_time(desk: Desk) -> None:
    desk.write(0x6067, 10)
    desk.write(0x6068, 40)
    desk.enable()
    axis(desk).offset = 11
    set_point(desk, 1000)
    desk.sync(500)
    assert not desk.status() & REACHED
    axis(desk).offset = 10
    desk.sync(10)
    assert not desk.status() & REACHED
    desk.sync(2)
    assert desk.status() & REACHED
    axis(desk).offset = -11
    desk.sync()
    assert not desk.status() & REACHED


def test_a_window_that_is_off_takes_the_demand_for_the_position(desk: Desk) -> None:
    desk.write(0x6067, 0xFFFF_FFFF)
    desk.write(0x6068, 0)
    desk.enable()
    axis(desk).offset = 5000
    set_point(desk, 1000)
    desk.sync(500)
    assert desk.status() & REACHED


# Limits


@pytest.mark.parametrize(("target", "clipped"), [(60_000, 50_000), (-70_000, -40_000)])
def test_a_target_outside_the_software_limits_is_clipped_and_reported(
    desk: Desk, target: int, clipped: int
) -> None:
    desk.write(0x607D, -40_000, 1)
    desk.write(0x607D, 50_000, 2)
    desk.enable()
    set_point(desk, target)
    assert desk.status() & (LIMIT | WARNING) == LIMIT | WARNING
    assert emergencies(desk) == [0x8612]
    desk.sync(2000)
    assert desk.read(0x6064) == clipped
    assert state(desk) == "operation enabled"
    set_point(desk, 0)
    assert not desk.status() & (LIMIT | WARNING)
    assert emergencies(desk) == [0x8612, 0]


def test_software_limits_are_off_while_the_lower_is_not_below_the_upper(desk: Desk) -> None:
    desk.write(0x607D, 0, 1)
    desk.write(0x607D, 0, 2)
    desk.enable()
    set_point(desk, 2_000_000)
    assert axis(desk).calls[-1][1] == 2_000_000


def test_maxima_bound_velocity_and_accelerations(desk: Desk) -> None:
    desk.write(0x607F, 9_000)
    desk.write(0x60C5, 8_000)
    desk.write(0x60C6, 7_000)
    desk.enable()
    set_point(desk, 100_000, velocity=50_000)
    assert axis(desk).calls[-1] == ("move", 100_000, 9_000, 8_000, 7_000)
    control(desk, DISABLE_VOLTAGE)
    desk.write(0x6080, 60)
    desk.enable()
    set_point(desk, 100_000, velocity=50_000)
    assert axis(desk).calls[-1] == ("move", 100_000, 4_096, 8_000, 7_000)


def test_only_modes_that_6502_names_can_be_chosen(master: canopen.Network) -> None:
    node = master[1]
    assert node.sdo[0x6502].raw == 1 | 1 << 5 | 1 << 7
    for mode in (-1, 0, 3, 7):
        with pytest.raises(Exception, match="Value range"):
            node.sdo[0x6060].raw = mode
    for mode in (6, 8, 1):
        node.sdo[0x6060].raw = mode
        assert node.sdo[0x6061].raw == mode


def test_a_long_sync_cycle_ends_a_stop_at_its_own_instant(desk: Desk) -> None:
    moving(desk)
    desk.write(0x1006, 1_000_000)
    disabled_at: list[float] = []
    first = axis(desk)
    disable = first.disable

    def noted() -> None:
        disabled_at.append(first.velocity)
        disable()

    first.disable = noted  # type: ignore[method-assign]
    control(desk, QUICK_STOP)
    desk.sync()
    assert state(desk) == "switch on disabled"
    assert disabled_at == [0.0]
