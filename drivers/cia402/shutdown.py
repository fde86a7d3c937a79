"""Stopping all axes and switching them off, whatever bus and drives do meanwhile.

Every SYNC each axis that does not yet show that it obeys is commanded again
(`drivers.cia402.stop`), and a command that the bus does not take keeps no other from being sent.
Before each of them what is fed forward to the axis is taken back.
All that come to rest wait for their brakes (`drivers_file.AxisDrive.brake_delay`), then their
voltage is disabled; an axis that runs on is switched off at once. If a drive shows that even this
has no effect, or if nobody can know, our heartbeat ceases, so that the drives' own watchdogs end
it: a watchdog may be released only where `Shutdown.off` says so, that is, where a drive has shown
that it is off and stands still.
"""

from __future__ import annotations

import math
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402.set_point import Standstill
from drivers.cia402.stop import AxisStop, StopPhase
from drivers.drive_bus import DriveError, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from drivers.cia402.states import Command
    from drivers.drives_file import AxisDrive
    from drivers.fieldbus import LifeSign, Objects, ProcessData

SETTLING_TIME = 0.04
"""For how long an axis must keep still to count as resting [s], and for `SETTLED` samples."""

SETTLED = 3
SAG_TIME = 0.3
"""For how long an axis is watched after its voltage was disabled [s]."""

ASK_TIME = 2.0
"""For how long drives are asked by SDO that show nothing otherwise [s]."""

LONGEST = 15.0
"""Real time after which a stop is given up whose SYNCs hardly pass, as with a dead plant [s]."""

REACTION_TIME = 2.0
"""How long a drive's own reaction to the loss of our heartbeat may take after the time-out [s]."""

_UNCERTAIN = SampleFlag.MISSING | SampleFlag.DOUBLED
"""What a drive showed is not certain: of two TPDOs the first may be an old one."""


class Shutdown:
    """Stops axes and switches them off; no `Exception` leaves it.

    Parameters
    ----------
    process_data : ProcessData
        Of all axes.
    life_sign : LifeSign
        Our heartbeat, kept going until it must cease.
    servers : sequence of Objects
        The drives in joint order.
    axes : sequence of AxisDrive
        What the drives file states of them.
    period, heartbeat_timeout : float
        Time between two SYNCs; after which drives miss our heartbeat [s].
    switch_off : callable
        Switches one drive off by SDO.

    Attributes
    ----------
    problems : list of str
        For the operator: what went wrong; grows.
    """

    def __init__(
        self,
        process_data: ProcessData,
        life_sign: LifeSign,
        servers: Sequence[Objects],
        axes: Sequence[AxisDrive],
        period: float,
        heartbeat_timeout: float,
        switch_off: Callable[[Objects], None],
    ) -> None:
        self.problems: list[str] = []
        self._switch_off_by_sdo = switch_off
        self._process_data = process_data
        self._life_sign = life_sign
        self._servers = servers
        self._axes = axes
        self._per_count = [abs(AxisScale.of(axis).position) for axis in axes]
        self._settled = max(SETTLED, math.ceil(SETTLING_TIME / period))
        self._settling = (self._settled + 2) * period
        self._period = period
        self._gives_up = math.inf
        self._reaction_time = heartbeat_timeout + REACTION_TIME
        self._stops: tuple[AxisStop, ...] = ()
        self._refused: dict[int, str] = {}

    @property
    def begun(self) -> bool:
        """The axes have been commanded to stop."""
        return bool(self._stops)

    @property
    def off(self) -> tuple[bool, ...]:
        """Which drives have shown that they are off, in joint order."""
        return tuple(stop.phase is StopPhase.OFF for stop in self._stops) or (False,) * len(
            self._axes
        )

    def begin(self, speeds: Sequence[float], decelerations: Sequence[float]) -> None:
        """Command all axes to stop, at once; does nothing where that was done.

        Parameters
        ----------
        speeds, decelerations : sequence of float, length n_axes
            How fast each may be, and how its drive slows down [rad/s, rad/s^2; m if prismatic].
        """
        if self.begun:
            return
        self._process_data.hurry(True)
        self._gives_up = monotonic() + LONGEST + max(axis.brake_delay for axis in self._axes)
        now, time = self._process_data.now(), self._process_data.time
        self._stops = tuple(
            AxisStop(
                now,
                time,
                position,
                speed=speed / per_count,
                deceleration=deceleration / per_count,
                window=axis.following_error_window / per_count,
                rest=Standstill(axis.position_window / per_count, self._settled),
                settling=self._settling,
                delay=2 * self._period,
            )
            for axis, position, speed, deceleration, per_count in zip(
                self._axes,
                self._process_data.positions,
                speeds,
                decelerations,
                self._per_count,
                strict=True,
            )
        )
        self._step(synced=False)

    def await_rest(self) -> None:
        """Let time pass until no axis is left that may still be moving under power."""
        while any(stop.phase in {StopPhase.STOPPING, StopPhase.DISABLING} for stop in self._stops):
            self._cycle()

    def switch_off(self) -> None:
        """Switch off all axes; those that do not show it are left to their watchdogs."""
        self.await_rest()
        while any(
            stop.phase is StopPhase.RESTING
            and stop.rested(self._process_data.now()) < axis.brake_delay
            for stop, axis in zip(self._stops, self._axes, strict=True)
        ):
            self._cycle()
        for stop in self._stops:
            if stop.phase is StopPhase.RESTING:
                stop.disable(self._process_data.now())
        while not all(stop.ended for stop in self._stops):
            self._cycle()
        if not all(self.off):
            self._life_sign.cease()
            self._ask_unseen()

    def conclude(self) -> list[str]:
        """Watch the axes that are off, and await the reaction of those that are not.

        Returns
        -------
        list of str
            Axes that have sagged, for the operator.
        """
        sagged = self._watch_rest()
        if not all(self.off):
            self._life_sign.cease()
            self._await_reactions()
        self.problems[:0] = self._left_on()
        return sagged

    def supervise(self) -> None:
        """Let a SYNC pass and see that all axes stay stopped."""
        self._cycle()

    def forget(self) -> None:
        """Be ready for another stop."""
        self._stops = ()
        self.problems = []
        self._refused.clear()
        self._process_data.hurry(False)

    def _cycle(self) -> None:
        synced = False
        for axis, stop in enumerate(self._stops):
            command = stop.unsent  # before SYNC: some drives act with it
            if command is not None:
                self._command(axis, stop, command)
        try:
            self._process_data.sync()
            synced = True
        except Exception:  # whatever a bus raises, the axes must stop
            self._process_data.miss()
        with suppress(DriveError):
            self._life_sign.beat()
        self._step(synced=synced)
        if monotonic() > self._gives_up:
            for stop in self._stops:
                stop.hang()

    def _step(self, *, synced: bool) -> None:
        process_data, time = self._process_data, self._process_data.now()
        for axis, stop in enumerate(self._stops):
            fresh = synced and not process_data.flags[axis] & _UNCERTAIN
            overrun = stop.overrun
            command = stop.step(
                time, process_data.words[axis], process_data.positions[axis], fresh=fresh
            )
            if stop.overrun is not overrun:
                self.problems.append(self._overran(axis, stop))
            if stop.phase is StopPhase.LOST:
                self._life_sign.cease()
            if command is not None:
                self._command(axis, stop, command)

    def _command(self, axis: int, stop: AxisStop, command: Command) -> None:
        with suppress(Exception):  # the command itself shows whether the bus takes anything
            self._process_data.withdraw(axis)
        try:
            for word in command.value:
                self._process_data.command(axis, self._process_data.positions[axis], word)
        except Exception as error:
            self._refused[axis] = str(error)
        else:
            self._refused.pop(axis, None)
            stop.sent(self._process_data.now())

    def _ask_unseen(self) -> None:
        """Ask drives by SDO whose TPDOs stay away, and switch them off that way."""
        ends = monotonic() + ASK_TIME
        for axis, (server, stop) in enumerate(zip(self._servers, self._stops, strict=True)):
            if stop.phase is StopPhase.UNSEEN and monotonic() < ends:
                try:
                    self._switch_off_by_sdo(server)
                    stop.phase = StopPhase.OFF
                except Exception as error:
                    self._refused[axis] = str(error)

    def _watch_rest(self) -> list[str]:
        """Watch where axes go that are off; one that does not come to rest is not off."""
        rests = [
            Standstill(axis.position_window / per_count, self._settled)
            for axis, per_count in zip(self._axes, self._per_count, strict=True)
        ]
        resting = [False] * len(rests)
        ends = self._process_data.now() + max(SAG_TIME, 2 * self._settling)
        gives_up = monotonic() + self._reaction_time
        while self._process_data.now() < ends and monotonic() < gives_up:
            self._cycle()
            positions = self._process_data.positions
            resting = [rest.update(p) for rest, p in zip(rests, positions, strict=True)]
        sagged: list[str] = []
        for axis, stop in enumerate(self._stops):
            if stop.phase is StopPhase.OFF and stop.left_at is not None:
                way = abs(self._process_data.positions[axis] - stop.left_at) * self._per_count[axis]
                sagged += self._judged(axis, stop, way, resting=resting[axis])
        return sagged

    def _judged(self, axis: int, stop: AxisStop, way: float, *, resting: bool) -> Iterable[str]:
        label, bound = self._servers[axis].label, self._axes[axis].position_window
        unit = self._axes[axis].unit
        if not resting:
            stop.give_up()
            self._refused[axis] = f"it still moves, by {way:.2g} {unit} until now"
        elif way > bound:
            yield (
                f"{label}: sagged by {way:.2g} {unit} after its voltage was off, at most "
                f"{bound:g} {unit} (position_window) may be; check its brake, and state how long it"
                " takes to close as brake_delay in the drives file"
            )

    def _await_reactions(self) -> None:
        ends, gives_up = (
            self._process_data.now() + self._reaction_time,
            monotonic() + self._reaction_time,
        )
        lost = [stop for stop in self._stops if stop.phase is not StopPhase.OFF]
        while any(stop.phase is not StopPhase.OFF for stop in lost):
            if self._process_data.now() > ends or monotonic() > gives_up:
                break  # in lock-step with a plant that is gone a period takes long
            self._cycle()
        self.problems += [
            f"{server.label}: did not switch off when commanded; its own reaction to the loss of "
            "our heartbeat did it"
            for server, stop in zip(self._servers, self._stops, strict=True)
            if stop in lost and stop.phase is StopPhase.OFF
        ]

    def _left_on(self) -> Iterable[str]:
        for axis, (server, stop) in enumerate(zip(self._servers, self._stops, strict=True)):
            if stop.phase is not StopPhase.OFF:
                shown = "nothing" if stop.state is None else stop.state.value
                why = f" ({self._refused[axis]})" if axis in self._refused else ""
                yield (
                    f"{server.label}: does not switch off, it shows {shown}{why}; its watchdog "
                    "stays armed and our heartbeat has ceased"
                )

    def _overran(self, axis: int, stop: AxisStop) -> str:
        assert stop.overrun is not None  # noqa: S101 - by the caller
        way, lasted = stop.overrun
        per_count = self._per_count[axis]
        unit = self._axes[axis].unit
        shown = "an undefined state" if stop.state is None else stop.state.value
        return (
            f"{self._servers[axis].label}: {lasted:.2g} s after quick stop it shows {shown} and has"
            f" gone on by {way * per_count:.2g} {unit}, at most {stop.bound.way * per_count:.2g} "
            f"{unit} and {stop.bound.time:.2g} s may pass until it rests; its voltage was disabled."
            " Check its quick stop (605A, 6085), brake and tuning, or state quick_stop_deceleration"
        )
