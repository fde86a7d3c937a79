"""Tables and pure functions of CiA 402, without bus, clock or side effects.

A drive is a state machine with its state in the statusword (6041) and commands in the controlword
(6040). The module contains both codings, the transitions, and the route between two states. A route
never passes through OPERATION ENABLED, where the motor is energised, unless that is its goal:
commands are found by a breadth-first search over a graph without that state. Numbers are those of
CiA 402-2.
"""

from __future__ import annotations

import enum
from collections import deque


class State(enum.Enum):
    """States of the power drive system."""

    NOT_READY = "NOT READY TO SWITCH ON"
    SWITCH_ON_DISABLED = "SWITCH ON DISABLED"
    READY_TO_SWITCH_ON = "READY TO SWITCH ON"
    SWITCHED_ON = "SWITCHED ON"
    OPERATION_ENABLED = "OPERATION ENABLED"
    QUICK_STOP_ACTIVE = "QUICK STOP ACTIVE"
    FAULT_REACTION_ACTIVE = "FAULT REACTION ACTIVE"
    FAULT = "FAULT"


class Command(enum.Enum):
    """Commands of the controlword: the words to send in turn."""

    SHUTDOWN = (0x0006,)
    SWITCH_ON = (0x0007,)
    ENABLE_OPERATION = (0x000F,)
    DISABLE_VOLTAGE = (0x0000,)
    QUICK_STOP = (0x0002,)
    FAULT_RESET = (0x0000, 0x0080)
    """Bit 7 acts by its rising edge, so it is cleared first."""


class Status(enum.IntFlag):
    """Bits of the statusword besides those of the state (profile position mode)."""

    VOLTAGE_ENABLED = 1 << 4
    WARNING = 1 << 7
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    SET_POINT_ACKNOWLEDGE = 1 << 12
    FOLLOWING_ERROR = 1 << 13


class Control(enum.IntFlag):
    """Bits of the controlword besides those of the state (profile position mode)."""

    NEW_SET_POINT = 1 << 4
    CHANGE_IMMEDIATELY = 1 << 5
    RELATIVE = 1 << 6
    HALT = 1 << 8


class Mode(enum.IntEnum):
    """Modes of operation (6060, 6061)."""

    PROFILE_POSITION = 1
    VELOCITY = 2
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_POSITION = 8
    CYCLIC_VELOCITY = 9
    CYCLIC_TORQUE = 10

    @property
    def supported_bit(self) -> int:
        """Mask of this mode in the supported drive modes (6502)."""
        return 1 << (self.value - 1)


MODE_TIME = 3.0
"""Longest delay of the mode display (6061) [s]."""

STATE_PATTERNS: tuple[tuple[State, int, int], ...] = (
    (State.NOT_READY, 0x4F, 0x00),
    (State.SWITCH_ON_DISABLED, 0x4F, 0x40),
    (State.READY_TO_SWITCH_ON, 0x6F, 0x21),
    (State.SWITCHED_ON, 0x6F, 0x23),
    (State.OPERATION_ENABLED, 0x6F, 0x27),
    (State.QUICK_STOP_ACTIVE, 0x6F, 0x07),
    (State.FAULT_REACTION_ACTIVE, 0x4F, 0x0F),
    (State.FAULT, 0x4F, 0x08),
)
"""State, mask and value of the statusword (CiA 402-2, table of state coding)."""

_STATE_OF = tuple(
    next((state for state, mask, value in STATE_PATTERNS if word & mask == value), None)
    for word in range(0x80)
)

_ON, _OFF = State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED
TRANSITIONS: dict[State, dict[Command, State]] = {
    State.NOT_READY: {},
    State.SWITCH_ON_DISABLED: {Command.SHUTDOWN: State.READY_TO_SWITCH_ON},
    State.READY_TO_SWITCH_ON: {
        Command.SWITCH_ON: State.SWITCHED_ON,
        Command.DISABLE_VOLTAGE: _OFF,
        Command.QUICK_STOP: _OFF,
    },
    State.SWITCHED_ON: {
        Command.ENABLE_OPERATION: _ON,
        Command.SHUTDOWN: State.READY_TO_SWITCH_ON,
        Command.DISABLE_VOLTAGE: _OFF,
        Command.QUICK_STOP: _OFF,
    },
    State.OPERATION_ENABLED: {
        Command.SWITCH_ON: State.SWITCHED_ON,
        Command.SHUTDOWN: State.READY_TO_SWITCH_ON,
        Command.DISABLE_VOLTAGE: _OFF,
        Command.QUICK_STOP: State.QUICK_STOP_ACTIVE,
    },
    State.QUICK_STOP_ACTIVE: {Command.DISABLE_VOLTAGE: _OFF},
    State.FAULT_REACTION_ACTIVE: {},
    State.FAULT: {Command.FAULT_RESET: _OFF},
}
"""States reached by each command. Transition 16 (quick stop active -> enabled) is left out: it is
optional, and one word must not energise a stopped axis again."""

PASSING_STATES = frozenset({State.NOT_READY, State.FAULT_REACTION_ACTIVE})
"""States that a drive leaves by itself, without a command."""


FAULTS = frozenset({State.FAULT, State.FAULT_REACTION_ACTIVE})
"""Fault states."""


class NoRoute(ValueError):
    """No permitted sequence of commands leads from a state to a goal."""


def decode_state(statusword: int) -> State | None:
    """Return the state in a statusword, None if the standard defines none."""
    return _STATE_OF[statusword & 0x7F]


def name_state(state: State | None) -> str:
    """Return the name of a state in messages."""
    return "an undefined state" if state is None else state.value


def route(state: State, goal: State, *, reset_fault: bool = False) -> tuple[Command, ...]:
    """Return the shortest sequence of commands from `state` to `goal`.

    Parameters
    ----------
    state, goal : State
        Present state, and desired state.
    reset_fault : bool
        Permit a fault reset; without it FAULT has no way out.

    Raises
    ------
    NoRoute
        The goal cannot be reached without a fault reset or without energising the drive.
    """
    waiting: deque[tuple[State, tuple[Command, ...]]] = deque([(state, ())])
    seen = {state}
    while waiting:
        here, commands = waiting.popleft()
        if here is goal:
            return commands
        for command, there in TRANSITIONS[here].items():
            energises = there is State.OPERATION_ENABLED and goal is not there
            refused = command is Command.FAULT_RESET and not reset_fault
            if there not in seen and not energises and not refused:
                seen.add(there)
                waiting.append((there, (*commands, command)))
    raise NoRoute(f"no permitted transitions from {state.value} to {goal.value}")


def next_command(state: State, goal: State, *, reset_fault: bool = False) -> Command | None:
    """Return the next command from `state` to `goal` (see `route`).

    Returns
    -------
    Command or None
        None at the goal, and in states that a drive leaves by itself.
    """
    if state is goal or state in PASSING_STATES:
        return None
    return route(state, goal, reset_fault=reset_fault)[0]
