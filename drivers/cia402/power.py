"""Power-on of all drives together, and power-off of a drive without process data.

Every drive is first brought to SWITCHED ON, without power at the motor; once all have arrived, they
proceed to OPERATION ENABLED and hold their position. Moving axes are stopped and switched off by
`drivers.cia402.shutdown`.
"""

from __future__ import annotations

import math
from time import monotonic
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.states import FAULTS, Command, State, decode_state, name_state, next_command
from drivers.cia402.stop import NOT_ENERGISED
from drivers.cia402.supervision import RESET, safe_torque_off
from drivers.drive_bus import DriveFault, DriveRefused, NodeSilent, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.cia402.supervision import Supervision
    from drivers.cycle_data import ProcessData
    from drivers.remote_dictionary import RemoteDictionary


class Deadline:
    """Deadline on two clocks, whichever is first: the bus of a dead plant has a slow clock.

    Parameters
    ----------
    duration : float
        Longest time by `clock` [s].
    clock : callable, optional
        Clock [s]; by default real time.
    real : float
        Longest real time [s].
    """

    def __init__(
        self, duration: float, clock: Callable[[], float] | None = None, *, real: float = math.inf
    ) -> None:
        self._clock = clock or monotonic
        self._ends = self._clock() + duration
        self._real_ends = monotonic() + real

    @property
    def passed(self) -> bool:
        """True after the deadline."""
        return self._clock() >= self._ends or monotonic() >= self._real_ends


STEP_TIME = 3.0
"""Longest time of a drive between two states [s]; brakes and DC links are slow."""

OFF_ATTEMPTS = 2


class Power:
    """Power-on and power-off of drives.

    Parameters
    ----------
    process_data : ProcessData
    servers : sequence of RemoteDictionary
        Drives in joint order.
    supervision : Supervision
        Describes faults.
    """

    def __init__(
        self,
        process_data: ProcessData,
        servers: Sequence[RemoteDictionary],
        supervision: Supervision,
    ) -> None:
        self._process_data, self._servers = process_data, servers
        self._supervision = supervision

    def wait(self, holds: Callable[[], bool], timeout: float) -> bool:
        """Let time pass until `holds` returns True; return False after `timeout` [s]."""
        over = Deadline(timeout, self._process_data.now)
        while not holds():
            if over.passed:
                return False
            self._process_data.tick()
        return True

    def make_safe(self, server: RemoteDictionary, *, reset_fault: bool) -> None:
        """Bring a drive from any state to SWITCH ON DISABLED.

        Raises
        ------
        DriveFault
            The drive is in a fault without permission to reset, or the fault returns.
        DriveRefused
            The drive does not reach the state.
        """
        if not self.wait(lambda: self._state(server) is not State.FAULT_REACTION_ACTIVE, STEP_TIME):
            raise DriveFault(f"{server.label}: fault reaction does not end; switch the drive off")
        if self._state(server) is State.FAULT:
            reason = self._supervision.reason(server)
            if not reset_fault:
                raise DriveFault(f"{server.label}: {State.FAULT.value}: {reason}; {RESET}")
            for word in Command.FAULT_RESET.value:
                server.put(objects.CONTROLWORD, word)
            if not self.wait(lambda: self._state(server) is not State.FAULT, STEP_TIME):
                raise DriveFault(
                    f"{server.label}: the fault returns after a reset: {reason}; remove the cause"
                )
        self.switch_off(server)

    def walk(self, goal: State, cycle: Callable[[], object]) -> None:
        """Bring the drives to `goal` together, with a command at every SYNC (`cycle`).

        Raises
        ------
        DriveFault, DriveRefused
            A drive faults, or does not reach the goal in time.
        """
        over = Deadline(STEP_TIME, self._process_data.now)
        while True:
            cycle()
            words = self._process_data.words
            states = [decode_state(word) for word in words]
            if all(state is goal for state in states):
                return
            late = over.passed
            for axis, (server, state) in enumerate(zip(self._servers, states, strict=True)):
                self._step(axis, server, state, goal, late=late)

    def switch_off(self, server: RemoteDictionary) -> None:
        """Switch a drive off by SDO, and check its state.

        Raises
        ------
        DriveRefused, NodeSilent
            The drive refuses the command, does not answer, or stays energised.
        """
        for attempt in range(OFF_ATTEMPTS):
            try:
                server.put(objects.CONTROLWORD, Command.DISABLE_VOLTAGE.value[0])
                break
            except (DriveRefused, NodeSilent):
                if attempt == OFF_ATTEMPTS - 1:
                    raise
        if not self.wait(lambda: self._state(server) in NOT_ENERGISED, STEP_TIME):
            raise DriveRefused(
                f"{server.label}: does not switch off, it shows {name_state(self._state(server))}; "
                "press the emergency stop"
            )

    def _state(self, server: RemoteDictionary) -> State | None:
        return decode_state(server.get(objects.STATUSWORD))

    def _step(
        self, axis: int, server: RemoteDictionary, state: State | None, goal: State, *, late: bool
    ) -> None:
        if state in FAULTS:
            raise self._supervision.diagnose(server, self._process_data.words[axis])
        if late and state is not goal:
            locked = safe_torque_off(server)
            if locked is not None:
                raise DriveRefused(
                    f"{server.label}: {locked}, so that {goal.value} cannot be reached; close "
                    "guards, and release emergency stops and safe torque off"
                )
            raise DriveRefused(
                f"{server.label}: stays in {name_state(state)}, {goal.value} was commanded; check"
                " supply voltage, enable input and safe torque off"
            )
        if self._process_data.flags[axis] & SampleFlag.MISSING or state is None:
            return
        command = next_command(state, goal)
        if command is not None:
            for word in command.value:
                self._process_data.command(axis, self._process_data.positions[axis], word)
