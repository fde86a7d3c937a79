"""Stopping all axes and switching them off, whatever bus and drives do meanwhile.

Every SYNC each axis that does not yet show that it obeys is commanded again
(`drivers.cia402.stop`), and a command that the bus does not take keeps no other from being sent: it
goes out as an object instead, and so does that of a drive that is lost.
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
from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.set_point import Standstill
from drivers.cia402.stop import AWAITED, AxisStop, StopPhase
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


@dataclass
class _Stopped:
    """One axis that is being stopped: why its last command was refused, why it is not off."""

    index: int
    server: Objects
    drive: AxisDrive
    per_count: float
    stop: AxisStop
    refused: str = ""
    reason: str = ""

    @property
    def off(self) -> bool:
        return self.stop.phase is StopPhase.OFF

    @property
    def shown(self) -> str:
        return "an undefined state" if self.stop.state is None else self.stop.state.value


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
        self._settled = max(SETTLED, math.ceil(SETTLING_TIME / period))
        self._settling = (self._settled + 2) * period
        self._period = period
        self._gives_up = math.inf
        self._reaction_time = heartbeat_timeout + REACTION_TIME
        self._stopped: tuple[_Stopped, ...] = ()

    @property
    def begun(self) -> bool:
        """The axes have been commanded to stop."""
        return bool(self._stopped)

    @property
    def off(self) -> tuple[bool, ...]:
        """Which drives have shown that they are off, in joint order."""
        return tuple(axis.off for axis in self._stopped) or (False,) * len(self._axes)

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
        motions = zip(self._axes, speeds, decelerations, strict=True)
        self._stopped = tuple(
            self._begun(index, drive, *motion) for index, (drive, *motion) in enumerate(motions)
        )
        self._step(synced=False)

    def _begun(self, index: int, drive: AxisDrive, speed: float, slowing: float) -> _Stopped:
        per_count, data = abs(AxisScale.of(drive).position), self._process_data
        stop = AxisStop(
            data.now(),
            data.time,
            data.positions[index],
            speed=speed / per_count,
            deceleration=slowing / per_count,
            window=drive.following_error_window / per_count,
            rest=Standstill(drive.position_window / per_count, self._settled),
            settling=self._settling,
            delay=2 * self._period,
        )
        return _Stopped(index, self._servers[index], drive, per_count, stop)

    def await_rest(self) -> None:
        """Let time pass until no axis is left that may still be moving under power."""
        while any(axis.stop.phase in AWAITED for axis in self._stopped):
            self._cycle()

    def switch_off(self) -> None:
        """Switch off all axes; those that do not show it are left to their watchdogs."""
        self.await_rest()
        while any(
            axis.stop.phase is StopPhase.RESTING
            and axis.stop.rested(self._process_data.now()) < axis.drive.brake_delay
            for axis in self._stopped
        ):
            self._cycle()
        for axis in self._stopped:
            axis.stop.disable(self._process_data.now())
        while not all(axis.stop.ended for axis in self._stopped):
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
        self._stopped = ()
        self.problems = []
        self._process_data.hurry(False)

    def _cycle(self) -> None:
        synced = False
        for axis in self._stopped:
            command = axis.stop.unsent  # before SYNC: some drives act with it
            if command is not None:
                self._command(axis, command)
        try:
            self._process_data.sync()
            synced = True
        except Exception:  # whatever a bus raises, the axes must stop
            self._process_data.miss()
        with suppress(DriveError):
            self._life_sign.beat()
        self._step(synced=synced)
        if monotonic() > self._gives_up:
            for axis in self._stopped:
                axis.stop.hang()

    def _step(self, *, synced: bool) -> None:
        data, time = self._process_data, self._process_data.now()
        for axis in self._stopped:
            index, stop = axis.index, axis.stop
            fresh = synced and not data.flags[index] & _UNCERTAIN
            overrun = stop.overrun
            command = stop.step(time, data.words[index], data.positions[index], fresh=fresh)
            if stop.overrun is not overrun:
                self.problems.append(_overran(axis))
            if stop.phase in {StopPhase.LOST, StopPhase.ADRIFT}:
                self._life_sign.cease()
            if command is not None:
                self._command(axis, command)

    def _command(self, axis: _Stopped, command: Command) -> None:
        index, data = axis.index, self._process_data
        with suppress(Exception):  # the command itself shows whether the bus takes anything
            data.withdraw(index)
        try:
            for word in command.value:
                data.command(index, data.positions[index], word)
        except Exception as error:
            axis.refused = str(error)
            taken = self._order(axis, command)
        else:
            axis.refused, taken = "", True
            if axis.stop.phase is StopPhase.LOST:  # the drive may take no process data any more
                self._order(axis, command)
        if taken:
            axis.stop.sent(data.now())

    def _order(self, axis: _Stopped, command: Command) -> bool:
        """Command an axis by objects; return whether the bus takes it."""
        try:
            for word in command.value:
                axis.server.order(objects.CONTROLWORD, word)
        except Exception:
            return False
        return True

    def _ask_unseen(self) -> None:
        """Ask drives by SDO whose TPDOs stay away, and switch them off that way."""
        ends = monotonic() + ASK_TIME
        for axis in self._stopped:
            if axis.stop.phase is StopPhase.UNSEEN and monotonic() < ends:
                try:
                    self._switch_off_by_sdo(axis.server)
                    axis.stop.phase = StopPhase.OFF
                except Exception as error:
                    axis.reason = str(error)

    def _watch_rest(self) -> list[str]:
        """Watch where axes go that are off; one that does not come to rest is not off."""
        rests = [
            Standstill(axis.drive.position_window / axis.per_count, self._settled)
            for axis in self._stopped
        ]
        resting = [False] * len(rests)
        ends = self._process_data.now() + max(SAG_TIME, 2 * self._settling)
        gives_up = monotonic() + self._reaction_time
        positions = self._process_data.positions
        while self._process_data.now() < ends and monotonic() < gives_up:
            self._cycle()
            positions = self._process_data.positions
            resting = [rest.update(p) for rest, p in zip(rests, positions, strict=True)]
        sagged: list[str] = []
        for axis in self._stopped:
            if axis.off and axis.stop.left_at is not None:
                way = abs(positions[axis.index] - axis.stop.left_at) * axis.per_count
                sagged += _judged(axis, way, resting=resting[axis.index])
        return sagged

    def _await_reactions(self) -> None:
        ends, gives_up = (
            self._process_data.now() + self._reaction_time,
            monotonic() + self._reaction_time,
        )
        lost = [axis for axis in self._stopped if not axis.off]
        while not all(axis.off for axis in lost):
            if self._process_data.now() > ends or monotonic() > gives_up:
                break  # in lock-step with a plant that is gone a period takes long
            self._cycle()
        self.problems += [
            f"{axis.server.label}: did not switch off when commanded; its own reaction to the loss "
            "of our heartbeat did it"
            for axis in lost
            if axis.off
        ]

    def _left_on(self) -> Iterable[str]:
        for axis in self._stopped:
            if not axis.off:
                shown = "nothing" if axis.stop.state is None else axis.shown
                why = axis.reason or axis.refused
                yield (
                    f"{axis.server.label}: does not switch off, it shows {shown}"
                    f"{f' ({why})' if why else ''}; its watchdog stays armed and our heartbeat has "
                    "ceased"
                )


def _judged(axis: _Stopped, way: float, *, resting: bool) -> Iterable[str]:
    unit, bound = axis.drive.unit, axis.drive.position_window
    if not resting:
        axis.stop.give_up()
        axis.reason = f"it still moves, by {way:.2g} {unit} until now"
    elif way > bound:
        yield (
            f"{axis.server.label}: sagged by {way:.2g} {unit} after its voltage was off, at most "
            f"{bound:g} {unit} (position_window) may be; check its brake, and state how long it"
            " takes to close as brake_delay in the drives file"
        )


def _overran(axis: _Stopped) -> str:
    assert axis.stop.overrun is not None  # noqa: S101 - by the caller
    (way, lasted), bound = axis.stop.overrun, axis.stop.bound
    unit = axis.drive.unit
    return (
        f"{axis.server.label}: {lasted:.2g} s after quick stop it shows {axis.shown} and has"
        f" gone on by {way * axis.per_count:.2g} {unit}, at most {bound.way * axis.per_count:.2g} "
        f"{unit} and {bound.time:.2g} s may pass until it rests; its voltage was disabled."
        " Check its quick stop (605A, 6085), brake and tuning, or state quick_stop_deceleration"
    )
