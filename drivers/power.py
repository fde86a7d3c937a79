"""Power on and power off, for all drives together.

On: every drive is first brought to SWITCHED ON, which energises no motor, and only when all are
there do they go on to OPERATION ENABLED, holding their position. Off: quick stop for all, wait
until they rest (with a bound), then each drive is switched off, whatever happens to the others;
what goes wrong is collected and reported.
"""

from __future__ import annotations

import time
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING

from drivers import objects
from drivers.cia402 import Command, State, decode_state, next_command
from drivers.drive_bus import BusUnavailable, DriveFault, DriveRefused, NodeSilent, SampleFlag
from drivers.interlocks import safe_torque_off
from drivers.set_point import Standstill

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.exchange import Exchange
    from drivers.heartbeat import Heartbeats
    from drivers.sdo import SdoServer
    from drivers.supervision import Supervision

STEP_TIME = 3.0
"""How long a drive may take from one state to another [s]; brakes and DC links are slow."""

STOP_TIME = 5.0
"""How long axes may take to come to rest before they are switched off all the same [s]."""

OFF_ATTEMPTS = 2
SETTLED = 10
"""Samples without motion after which an axis counts as resting when powering off."""

_ENERGISED = frozenset(
    {
        State.SWITCHED_ON,
        State.OPERATION_ENABLED,
        State.QUICK_STOP_ACTIVE,
        State.FAULT_REACTION_ACTIVE,
    }
)
_SHOWN_OFF = frozenset({State.SWITCH_ON_DISABLED, State.FAULT})
_FAULTS = frozenset({State.FAULT, State.FAULT_REACTION_ACTIVE})
_STOPPING = frozenset({State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE})


class Power:
    """Switches drives on and off.

    Parameters
    ----------
    exchange : Exchange
        Process data.
    servers : sequence of SdoServer
        The drives in joint order.
    supervision : Supervision
        Puts faults into words.
    heartbeats : Heartbeats
        Kept going while axes come to rest.
    now : callable
        Time [s].
    bands : sequence of float
        Motion within which an axis counts as resting [increments].
    """

    def __init__(
        self,
        exchange: Exchange,
        servers: Sequence[SdoServer],
        supervision: Supervision,
        heartbeats: Heartbeats,
        now: Callable[[], float],
        bands: Sequence[float],
    ) -> None:
        self._exchange = exchange
        self._servers = servers
        self._supervision = supervision
        self._heartbeats = heartbeats
        self._now = now
        self._bands = bands

    def wait(self, holds: Callable[[], bool], timeout: float) -> bool:
        """Let time pass until a condition holds; return whether it did within `timeout` [s]."""
        ends = self._now() + timeout
        while not holds():
            if self._now() > ends:
                return False
            self._exchange.tick()
        return True

    def make_safe(self, server: SdoServer, *, reset_fault: bool) -> None:
        """Bring a drive in whatever state to SWITCH ON DISABLED.

        Raises
        ------
        DriveFault
            It is in a fault that nobody asked to reset, or that comes back.
        DriveRefused
            It does not get there.
        """
        if not self.wait(lambda: self._state(server) is not State.FAULT_REACTION_ACTIVE, STEP_TIME):
            raise DriveFault(f"{server.label}: does not end its fault reaction; switch it off")
        if self._state(server) is State.FAULT:
            self._reset(server, permitted=reset_fault)
        self._off(server)

    def walk(self, goal: State, cycle: Callable[[], None]) -> None:
        """Bring all drives to `goal` together, one command and one SYNC (`cycle`) at a time.

        Raises
        ------
        DriveFault, DriveRefused
            A drive faults, or does not get there in time.
        """
        ends = self._now() + STEP_TIME
        while True:
            cycle()
            words = self._exchange.words
            states = [decode_state(word) for word in words]
            if all(state is goal for state in states):
                return
            late = self._now() > ends
            for axis, (server, state) in enumerate(zip(self._servers, states, strict=True)):
                self._step(axis, server, state, goal, late=late)

    def power_down(
        self,
        commissioned: Sequence[SdoServer],
        *,
        running: bool,
        when_off: Callable[[], None] = lambda: None,
    ) -> list[str]:
        """Stop all axes and switch off every drive; never raises an `Exception`.

        Parameters
        ----------
        commissioned : sequence of SdoServer
            The drives that we have configured.
        running : bool
            Process data is being exchanged, so that axes can be stopped first.
        when_off : callable
            Called when all are off and process data still come.

        Returns
        -------
        list of str
            What went wrong.
        """
        problems: list[str] = []
        if running:
            self._attempt(problems, "stopping", lambda: self._command_all(Command.QUICK_STOP))
            self._attempt(problems, "waiting for standstill", self._await_rest)
            self._attempt(problems, "off", self._disable_all)
        shown_off = self._shown_off() if running else []
        for server in commissioned:
            if server not in shown_off:
                self._attempt(problems, "switching off", partial(self._off, server))
        if running and not problems:
            self._attempt(problems, "off", when_off)
        for server in commissioned:  # one that cannot be told misses our heartbeat, nothing worse
            self._attempt([], "releasing", partial(_release, server))
        return problems

    def stop(self) -> None:
        """Command all axes to stop (quick stop), as far as the bus still carries it."""
        with suppress(BusUnavailable):
            self._command_all(Command.QUICK_STOP)

    def _state(self, server: SdoServer) -> State | None:
        return decode_state(server.get(objects.STATUSWORD))

    def _reset(self, server: SdoServer, *, permitted: bool) -> None:
        reason = self._supervision.reason(server)
        if not permitted:
            raise DriveFault(
                f"{server.label}: {State.FAULT.value}: {reason}; remove the cause, then reset the "
                "fault"
            )
        for word in Command.FAULT_RESET.value:
            server.put(objects.CONTROLWORD, word)
        if not self.wait(lambda: self._state(server) is not State.FAULT, STEP_TIME):
            raise DriveFault(
                f"{server.label}: the fault comes back after a reset: {reason}; remove the cause"
            )

    def _off(self, server: SdoServer) -> None:
        for attempt in range(OFF_ATTEMPTS):
            try:
                server.put(objects.CONTROLWORD, Command.DISABLE_VOLTAGE.value[0])
                break
            except (DriveRefused, NodeSilent):
                if attempt == OFF_ATTEMPTS - 1:
                    raise
        if not self.wait(lambda: self._state(server) not in _ENERGISED, STEP_TIME):
            state = self._state(server)
            raise DriveRefused(
                f"{server.label}: does not switch off, it shows "
                f"{'an undefined state' if state is None else state.value}; "
                "press the emergency stop"
            )

    def _step(
        self, axis: int, server: SdoServer, state: State | None, goal: State, *, late: bool
    ) -> None:
        if state in _FAULTS:
            raise self._supervision.diagnose(server, self._exchange.words[axis])
        if late and state is not goal:
            locked = safe_torque_off(server)
            if locked is not None:
                raise DriveRefused(
                    f"{server.label}: {locked}, so that {goal.value} cannot be reached; close "
                    "guards and emergency stops, and release it"
                )
            shown = "an undefined state" if state is None else state.value
            raise DriveRefused(
                f"{server.label}: stays in {shown}, {goal.value} was commanded; check supply "
                "voltage, enable input and safe torque off"
            )
        if self._exchange.flags[axis] & SampleFlag.MISSING or state is None:
            return
        command = next_command(state, goal)
        if command is not None:
            self._command(axis, command)

    def _command(self, axis: int, command: Command) -> None:
        position = self._exchange.positions[axis]
        for word in command.value:
            self._exchange.command(axis, position, word)

    def _command_all(self, command: Command) -> None:
        for axis in range(len(self._servers)):
            self._command(axis, command)

    def _disable_all(self) -> None:
        self._command_all(Command.DISABLE_VOLTAGE)
        for _ in range(SETTLED):
            self._exchange.sync()
            if len(self._shown_off()) == len(self._servers):
                return

    def _shown_off(self) -> list[SdoServer]:
        """Drives whose last TPDO showed them off; they need no answer to a request as well."""
        exchange = self._exchange
        return [
            server
            for server, word, flag in zip(
                self._servers, exchange.words, exchange.flags, strict=True
            )
            if decode_state(word) in _SHOWN_OFF and not flag & SampleFlag.MISSING
        ]

    def _await_rest(self) -> None:
        rests = [Standstill(band, SETTLED) for band in self._bands]
        ends, gives_up = self._now() + STOP_TIME, time.monotonic() + 2 * STOP_TIME
        while True:
            self._exchange.sync()
            self._heartbeats.beat()
            exchange = self._exchange
            moving = [
                server.label
                for server, rest, word, position, flag in zip(
                    self._servers,
                    rests,
                    exchange.words,
                    exchange.positions,
                    exchange.flags,
                    strict=True,
                )
                if not rest.update(position)
                and decode_state(word) in _STOPPING
                and not flag & SampleFlag.MISSING
            ]
            if not moving:
                return
            if self._now() > ends or time.monotonic() > gives_up:
                raise DriveRefused(f"{', '.join(moving)}: still moving {STOP_TIME:g} s after stop")

    @staticmethod
    def _attempt(problems: list[str], what: str, step: Callable[[], None]) -> None:
        try:
            step()
        except (Exception, KeyboardInterrupt) as error:
            problems.append(f"{what}: {error or type(error).__name__}")


def _release(server: SdoServer) -> None:
    server.enter_pre_operational()
    if server.find(objects.CONSUMER_HEARTBEAT):
        server.put(objects.CONSUMER_HEARTBEAT, 0)
