"""CiA 402 without a bus: states, transitions, handshake, error codes."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402.error_codes import ERROR_CODES, decode_emergency, error_text
from drivers.cia402.set_point import (
    ENABLED,
    RAISED,
    HaltedAxis,
    Phase,
    SetPoint,
    Standstill,
)
from drivers.cia402.states import (
    TRANSITIONS,
    Command,
    Mode,
    NoRoute,
    State,
    decode_state,
    next_command,
    route,
)

WORDS = {
    State.NOT_READY: ((0x4F, 0x00),),
    State.SWITCH_ON_DISABLED: ((0x4F, 0x40),),
    State.READY_TO_SWITCH_ON: ((0x6F, 0x21),),
    State.SWITCHED_ON: ((0x6F, 0x23),),
    State.OPERATION_ENABLED: ((0x6F, 0x27),),
    State.QUICK_STOP_ACTIVE: ((0x6F, 0x07),),
    State.FAULT_REACTION_ACTIVE: ((0x4F, 0x0F),),
    State.FAULT: ((0x4F, 0x08),),
}
"""Mask and value of CiA 402-2, table 29, repeated independently of the product code."""


def test_every_one_of_65536_statuswords_decodes_as_the_standard_says() -> None:
    for word in range(0x10000):
        expected = [s for s, ((mask, value),) in WORDS.items() if word & mask == value]
        assert len(expected) <= 1
        assert decode_state(word) is (expected[0] if expected else None)


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0250, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY_TO_SWITCH_ON),
        (0x0233, State.SWITCHED_ON),
        (0x1637, State.OPERATION_ENABLED),
        (0x0217, State.QUICK_STOP_ACTIVE),
        (0x0218, State.FAULT),
        (0x021F, State.FAULT_REACTION_ACTIVE),
        (0x0001, None),
    ],
)
def test_statuswords_as_drives_really_show_them(word: int, state: State | None) -> None:
    assert decode_state(word) is state


def _walk(state: State, commands: tuple[Command, ...]) -> list[State]:
    return [state := TRANSITIONS[state][command] for command in commands]


@pytest.mark.parametrize(("state", "goal"), list(itertools.product(State, State)))
def test_no_route_passes_through_operation_enabled_unless_that_is_its_goal(
    state: State, goal: State
) -> None:
    for reset_fault in (False, True):
        try:
            commands = route(state, goal, reset_fault=reset_fault)
        except NoRoute:
            continue
        passed = _walk(state, commands)
        assert not commands or passed[-1] is goal
        assert State.OPERATION_ENABLED not in passed[:-1]


def test_quick_stop_cannot_be_reached_from_a_drive_that_is_off() -> None:
    for state in (State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON):
        with pytest.raises(NoRoute, match="QUICK STOP ACTIVE"):
            next_command(state, State.QUICK_STOP_ACTIVE)


def test_a_stopped_drive_goes_through_off_before_it_is_enabled_again() -> None:
    commands = route(State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED)
    assert commands == (
        Command.DISABLE_VOLTAGE,
        Command.SHUTDOWN,
        Command.SWITCH_ON,
        Command.ENABLE_OPERATION,
    )


@pytest.mark.parametrize("state", [s for s in State if TRANSITIONS[s] and s is not State.FAULT])
def test_a_drive_can_be_switched_off_by_one_command_at_most_two(state: State) -> None:
    assert len(route(state, State.SWITCH_ON_DISABLED)) <= 2


def test_a_fault_is_reset_only_when_asked_for() -> None:
    with pytest.raises(NoRoute, match="FAULT"):
        next_command(State.FAULT, State.OPERATION_ENABLED)
    command = next_command(State.FAULT, State.SWITCH_ON_DISABLED, reset_fault=True)
    assert command is Command.FAULT_RESET


def test_fault_reset_makes_a_rising_edge() -> None:
    low, high = Command.FAULT_RESET.value
    assert not low & 0x80
    assert high & 0x80


def test_controlwords_are_those_of_the_standard() -> None:
    words = {command.name: command.value[-1] for command in Command}
    assert words == {
        "SHUTDOWN": 0x06,
        "SWITCH_ON": 0x07,
        "ENABLE_OPERATION": 0x0F,
        "DISABLE_VOLTAGE": 0x00,
        "QUICK_STOP": 0x02,
        "FAULT_RESET": 0x80,
    }


@pytest.mark.parametrize("state", [State.NOT_READY, State.FAULT_REACTION_ACTIVE])
def test_states_that_a_drive_leaves_by_itself_are_waited_for(state: State) -> None:
    assert next_command(state, State.OPERATION_ENABLED) is None


def test_nothing_is_commanded_at_the_goal() -> None:
    assert all(next_command(state, state) is None for state in State)


def test_profile_position_is_bit_0_of_the_supported_modes() -> None:
    assert Mode.PROFILE_POSITION.supported_bit == 0x01
    assert Mode.CYCLIC_TORQUE.supported_bit == 0x200


# The set-point handshake

ACKNOWLEDGE, REACHED = 0x1000, 0x0400
IDLE = 0x0637


def _set_point(target: int = 1000, count: int = 2) -> SetPoint:
    return SetPoint(target, window=10, rest=Standstill(band=2, count=count))


def _accepted() -> SetPoint:
    set_point = _set_point()
    set_point.step(0x0237, 0)
    set_point.step(0x0237 | ACKNOWLEDGE, 0)
    set_point.step(0x0237, 0)
    assert set_point.phase is Phase.TRAVELLING
    return set_point


def test_the_handshake_raises_bit_4_waits_for_bit_12_and_drops_bit_4() -> None:
    set_point = _set_point()
    words = [
        set_point.step(word, 0)
        for word in (IDLE, IDLE, IDLE | ACKNOWLEDGE, IDLE | ACKNOWLEDGE, 0x0237)
    ]
    assert words == [RAISED, None, ENABLED, None, None]
    assert RAISED & 0x10
    assert not ENABLED & 0x10


def test_bit_4_is_not_raised_while_an_earlier_acknowledge_stands() -> None:
    set_point = _set_point()
    assert set_point.step(IDLE | ACKNOWLEDGE, 0) is None
    assert set_point.step(IDLE, 0) == RAISED


def test_a_stale_target_reached_bit_does_not_count_before_the_handshake_is_over() -> None:
    set_point = _set_point(target=5)
    for word in (IDLE, IDLE, IDLE | ACKNOWLEDGE, IDLE | ACKNOWLEDGE):
        set_point.step(word, 5)
        assert set_point.phase is not Phase.REACHED


def test_a_stale_target_reached_bit_does_not_count_far_from_the_target() -> None:
    set_point = _accepted()
    for _ in range(10):
        set_point.step(0x0237 | REACHED, 0)
    assert set_point.phase is Phase.TRAVELLING


def test_passing_through_the_window_is_not_arriving() -> None:
    set_point = _accepted()
    for position in range(900, 1100, 4):
        set_point.step(0x0237 | REACHED, position)
    assert set_point.phase is Phase.TRAVELLING


def test_resting_in_the_window_counts_only_once_the_drive_says_reached() -> None:
    set_point = _accepted()
    for _ in range(10):
        set_point.step(0x0237, 1001)
    assert set_point.phase is Phase.TRAVELLING
    set_point.step(0x0237 | REACHED, 1001)
    assert set_point.phase is Phase.REACHED


def test_a_move_of_zero_length_is_reached_though_bit_10_never_falls() -> None:
    set_point = _set_point(target=0)
    for word in (IDLE, IDLE | ACKNOWLEDGE, IDLE, IDLE, IDLE):
        set_point.step(word, 0)
    assert set_point.phase is Phase.REACHED


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.integers(-20, 1020)), max_size=60))
def test_whatever_a_drive_shows_reached_means_handshake_window_and_bit_10(
    shown: list[tuple[int, int]],
) -> None:
    set_point, sent = _set_point(), []
    for word, position in shown:
        sent.append(set_point.step(word, position))
        if set_point.phase is Phase.REACHED:
            assert word & REACHED
            assert abs(position - 1000) <= 10
            assert [w for w in sent if w is not None] == [RAISED, ENABLED]
            return
        assert [w for w in sent if w is not None] in ([], [RAISED], [RAISED, ENABLED])


def test_a_halted_axis_has_come_to_rest_when_its_position_stays() -> None:
    stopping = HaltedAxis(Standstill(band=1, count=3))
    for position in (0, 10, 18, 24, 28, 30, 30, 30):
        assert stopping.step(0, position) is None
        assert stopping.phase is Phase.TRAVELLING
    stopping.step(0, 30)
    assert stopping.phase is Phase.REACHED


# Error codes


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8611, "8611 (following error too large)"),
        (0x8130, "8130 (heartbeat of the master lost)"),
        (0x2311, "2311 (continuous over-current)"),
        (0x3299, "3299 (DC link voltage)"),
        (0xFF42, "FF42 (specific to the maker: see the drive's manual)"),
        (0xA123, "A123 (unknown error)"),
    ],
)
def test_an_error_code_is_told_in_words_if_need_be_by_its_class(code: int, text: str) -> None:
    assert error_text(code) == text


def test_codes_stand_in_the_standard_s_ascending_order_each_of_two_bytes() -> None:
    codes = list(ERROR_CODES)
    assert codes == sorted(codes)
    assert (codes[0], codes[-1]) == (0x0000, 0xFF00)


def test_an_emergency_frame_is_decoded() -> None:
    emergency = decode_emergency(bytes.fromhex("11 86 20 01 02 00 00 00"))
    assert (emergency.code, emergency.register) == (0x8611, 0x20)
    assert str(emergency) == (
        "8611 (following error too large), error register 20, maker's data 01 02 00 00 00"
    )


@given(st.binary(max_size=8))
def test_any_emergency_frame_of_any_length_can_be_told(data: bytes) -> None:
    assert str(decode_emergency(data))
