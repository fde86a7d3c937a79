"""Emergency stop and power-off of all axes, also with failures of bus and drives.

At every SYNC each drive that does not show the commanded state is commanded again
(`drivers.cia402.stop`). A command in process data that the bus refuses is sent by SDO instead, as
is every command to a lost drive. Each command is preceded by a cancellation of the feed-forward.
Axes at rest wait for their brakes (`drivers_file.AxisDrive.brake_delay`), then their voltage is
disabled; an axis that runs on is switched off at once. If a drive stays on all the same, or its
state is unknown, the master's heartbeat ceases, so that the watchdogs stop all drives: a watchdog
may be released only for drives that have shown power-off and standstill (`Shutdown.off`).
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.power import Deadline
from drivers.cia402.set_point import Standstill
from drivers.cia402.states import name_state
from drivers.cia402.stop import AWAITED, AxisStop, StopPhase
from drivers.drive_bus import DriveError, NodeSilent, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from drivers.axis import Axis
    from drivers.cia402.states import Command
    from drivers.cycle_data import ProcessData
    from drivers.fieldbus import LifeSign
    from drivers.remote_dictionary import RemoteDictionary

SETTLING_TIME = 0.04
"""Minimum standstill of a resting axis [s], with at least `SETTLED` samples."""

SETTLED = 3
SAG_TIME = 0.3
"""Observation time after power-off, for a sagging axis [s]."""

ASK_TIME = 2.0
"""Longest time to read the state of silent drives by SDO [s]."""

LONGEST = 15.0
"""Maximum real time of a stop [s], for a bus on which SYNCs hardly pass, as with a dead plant."""

REACTION_TIME = 2.0
"""Longest reaction of a drive to the loss of our heartbeat after the time-out [s]."""

_UNCERTAIN = SampleFlag.MISSING | SampleFlag.DOUBLED
"""Flags of an uncertain state: of two TPDOs the first may be an old one."""


@dataclass
class _Stopped:
    """Axis under stop, with the reasons of a refused command and of a failed power-off."""

    axis: Axis
    stop: AxisStop
    refused: str = ""
    reason: str = ""

    @property
    def off(self) -> bool:
        return self.stop.phase is StopPhase.OFF


class Shutdown:
    """Stop and power-off of axes; no `Exception` leaves this class.

    Parameters
    ----------
    process_data : ProcessData
    life_sign : LifeSign
        Life sign, sent until it must cease.
    axes : sequence of Axis
        Axes in joint order.
    period : float
        Time between two SYNCs [s].
    switch_off : callable
        Switches one drive off by SDO.

    Attributes
    ----------
    problems : list of str
        Failures for the operator; the list grows.
    """

    def __init__(
        self,
        process_data: ProcessData,
        life_sign: LifeSign,
        axes: Sequence[Axis],
        period: float,
        switch_off: Callable[[RemoteDictionary], None],
    ) -> None:
        self.problems: list[str] = []
        self._switch_off_by_objects, self._process_data = switch_off, process_data
        self._life_sign, self._axes = life_sign, axes
        self._settled = max(SETTLED, math.ceil(SETTLING_TIME / period))
        self._settling = (self._settled + 2) * period
        self._period = period
        self._longest = Deadline(math.inf)
        self._reaction_time = life_sign.timeout + REACTION_TIME
        self._stopped: tuple[_Stopped, ...] = ()

    @property
    def begun(self) -> bool:
        """True after the stop command."""
        return bool(self._stopped)

    @property
    def off(self) -> tuple[bool, ...]:
        """Drives with confirmed power-off, in joint order."""
        return tuple(each.off for each in self._stopped) or (False,) * len(self._axes)

    def begin(self, speeds: Sequence[float], decelerations: Sequence[float]) -> None:
        """Command all axes to stop at once; no effect after the first call.

        Parameters
        ----------
        speeds, decelerations : sequence of float, length n_axes
            Largest speed of each axis, and its deceleration [rad/s, rad/s^2; m if prismatic].
        """
        if self.begun:
            return
        self._process_data.hurry(True)
        self._longest = Deadline(LONGEST + max(axis.drive.brake_delay for axis in self._axes))
        data = self._process_data
        stops = (
            AxisStop(
                data.now(),
                data.time,
                data.positions[axis.index],
                speed=speeds[axis.index] / axis.per_count,
                deceleration=decelerations[axis.index] / axis.per_count,
                window=axis.window,
                rest=Standstill(axis.band, self._settled),
                settling=self._settling,
                delay=2 * self._period,
            )
            for axis in self._axes
        )
        self._stopped = tuple(map(_Stopped, self._axes, stops))
        self._step(synced=False)

    def await_rest(self) -> None:
        """Let time pass while an axis may still be moving under power."""
        while any(each.stop.phase in AWAITED for each in self._stopped):
            self.supervise()

    def switch_off(self) -> None:
        """Switch off all axes; those without confirmation are left to their watchdogs."""
        self.await_rest()
        while any(
            each.stop.phase is StopPhase.RESTING
            and each.stop.resting_time(self._process_data.now()) < each.axis.drive.brake_delay
            for each in self._stopped
        ):
            self.supervise()
        for each in self._stopped:
            each.stop.disable(self._process_data.now())
        while not all(each.stop.ended for each in self._stopped):
            self.supervise()
        if not all(self.off):
            self._life_sign.cease()
        over = Deadline(ASK_TIME)
        for each in self._stopped:  # silent drives are asked, and switched off, by SDO
            if each.stop.phase is StopPhase.UNSEEN and not over.passed:
                server = each.axis.server
                try:
                    try:
                        self._switch_off_by_objects(server)
                    except NodeSilent:  # a drive may answer in pre-operational only
                        server.access.leave_operational()
                        self._switch_off_by_objects(server)
                    each.stop.phase = StopPhase.OFF
                except Exception as error:
                    each.reason = str(error)

    def conclude(self) -> list[str]:
        """Watch axes after power-off, and wait for the reaction of drives that are still on.

        Returns
        -------
        list of str
            Messages about axes that have sagged.
        """
        sagged = self._watch_rest()
        if not all(self.off):
            self._life_sign.cease()
            lost = [each for each in self._stopped if not each.off]
            over = Deadline(self._reaction_time, self._process_data.now, real=self._reaction_time)
            while not (all(each.off for each in lost) or over.passed):
                self.supervise()
            self.problems += [
                f"{each.axis.label}: not switched off by command, only by its own reaction to "
                f"the loss of {self._life_sign.name}"
                for each in lost
                if each.off
            ]
        self.problems[:0] = self._list_powered()
        return sagged

    def forget(self) -> None:
        """Prepare for another stop."""
        self._stopped = ()
        self.problems = []
        self._process_data.hurry(False)

    def supervise(self) -> None:
        """Let a SYNC pass and command axes that do not obey."""
        synced = False
        for each in self._stopped:
            command = each.stop.unsent  # before SYNC, since some drives act at SYNC
            if command is not None:
                self._command(each, command)
        try:
            self._process_data.sync()
            synced = True
        except Exception:  # the axes must stop after any error of the bus
            self._process_data.miss()
        with suppress(DriveError):
            self._life_sign.beat()
        self._step(synced=synced)
        if self._longest.passed:
            for each in self._stopped:
                each.stop.hang()

    def _step(self, *, synced: bool) -> None:
        data, time = self._process_data, self._process_data.now()
        for each in self._stopped:
            index, stop = each.axis.index, each.stop
            fresh = synced and not data.flags[index] & _UNCERTAIN
            overrun = stop.overrun
            command = stop.step(time, data.words[index], data.positions[index], fresh=fresh)
            if stop.overrun is not overrun:
                self.problems.append(_describe_overrun(each))
            if stop.phase in {StopPhase.LOST, StopPhase.ADRIFT}:
                self._life_sign.cease()
            if command is not None:
                self._command(each, command)

    def _command(self, each: _Stopped, command: Command) -> None:
        index, data = each.axis.index, self._process_data
        with suppress(Exception):  # the command itself shows whether the bus accepts anything
            data.withdraw(index)
        try:
            for word in command.value:
                data.command(index, data.positions[index], word)
        except Exception as error:
            each.refused = str(error)
            taken = _order(each.axis, command)
        else:
            each.refused, taken = "", True
            if each.stop.phase is StopPhase.LOST:  # the drive may ignore process data
                _order(each.axis, command)
        if taken:
            each.stop.note_sent(data.now())

    def _watch_rest(self) -> list[str]:
        """Watch axes after power-off; an axis that does not come to rest is not off."""
        data = self._process_data
        rests = [Standstill(axis.band, self._settled) for axis in self._axes]
        resting = [False] * len(rests)
        watched = max(SAG_TIME, 2 * self._settling)
        over = Deadline(watched, data.now, real=self._reaction_time)
        while not over.passed:
            self.supervise()
            resting = [rest.update(p) for rest, p in zip(rests, data.positions, strict=True)]
        sagged: list[str] = []
        for each in self._stopped:
            index, left_at = each.axis.index, each.stop.left_at
            if each.off and left_at is not None:
                way = abs(data.positions[index] - left_at) * each.axis.per_count
                unit, bound = each.axis.drive.unit, each.axis.drive.position_window
                if not resting[index]:
                    each.stop.give_up()
                    each.reason = f"it still moves, by {way:.2g} {unit} until now"
                elif way > bound:
                    sagged.append(
                        f"{each.axis.label}: sagged by {way:.2g} {unit} after its voltage was "
                        f"off, at most {bound:g} {unit} (position_window) allowed; check its "
                        "brake, and state the closing time of the brake as brake_delay in the "
                        "drives file"
                    )
        return sagged

    def _list_powered(self) -> Iterable[str]:
        alike: dict[tuple[str, str], list[str]] = {}
        for each in self._stopped:
            if not each.off:
                shown = "nothing" if each.stop.state is None else each.stop.state.value
                why = (each.reason or each.refused).removeprefix(f"{each.axis.label}: ")
                alike.setdefault((shown, f" ({why})" if why else ""), []).append(each.axis.label)
        for (shown, why), labels in alike.items():
            yield (
                f"{', '.join(labels)}: does not switch off, it shows {shown}{why}; its watchdog "
                f"stays armed and {self._life_sign.name} has stopped"
            )


def _order(axis: Axis, command: Command) -> bool:
    """Command an axis by SDO; return False if the bus refuses."""
    try:
        for word in command.value:
            axis.server.order(objects.CONTROLWORD, word)
    except Exception:
        return False
    return True


def _describe_overrun(each: _Stopped) -> str:
    assert each.stop.overrun is not None  # noqa: S101 - by the caller
    (way, lasted), bound, axis = each.stop.overrun, each.stop.bound, each.axis
    unit = axis.drive.unit
    return (
        f"{axis.label}: {lasted:.2g} s after quick stop: state {name_state(each.stop.state)}, "
        f"moved by {way * axis.per_count:.2g} {unit}, at most {bound.way * axis.per_count:.2g} "
        f"{unit} and {bound.time:.2g} s allowed until rest; its voltage was disabled. Check its "
        "quick stop (605A, 6085), brake and tuning, or state quick_stop_deceleration"
    )
