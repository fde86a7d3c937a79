"""Stop of an axis: quick stop, standstill, voltage off; every step confirmed or bounded.

A command may be lost, ignored, or acknowledged without effect. So each step is commanded anew at
every SYNC until the drive shows the commanded state, and each step has a bound. After a quick stop
an axis of speed v and deceleration a may continue for at most::

    way  = window + v (STOP_DELAY + age) + STOP_MARGIN v^2 / (2 a)
    time = STOP_DELAY + STOP_MARGIN v / a  (and until standstill is certain)

where window is the following error window, and age is that of the last position at the command plus
two SYNCs, since some drives act at the next SYNC. The voltage of an axis is disabled beyond either
bound, if the drive does not confirm the stop within STOP_DELAY, or if the bus refuses the command
and the telegrams show no reaction. A drive that does not confirm power-off in time is lost: only
its own watchdog can stop it, but it is still commanded to switch off.

One table gives the consequences of an observation (`next_step`), another those of a passed bound
(`overdue_phase`). Positions are in increments; nothing is sent and nothing waits: `AxisStop.step`
evaluates one SYNC.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402.states import Command, State, decode_state

if TYPE_CHECKING:
    from drivers.cia402.set_point import Standstill

STOP_DELAY = 0.1
"""Longest reaction time of a drive and its loops to a stop command [s]."""

STOP_MARGIN = 1.5
"""Factor of the bounds on time and distance of a stop over those by the stated deceleration."""

OFF_TIME = 0.5
"""Longest time of a drive at rest to switch off [s]; the drive may close a brake first."""

OFF_TIME_MOVING = 0.2
"""Longest time to switch off for an axis that did not stop properly [s]."""

UNSENT_TIME = 2.0
"""Longest time to repeat a command refused by the bus [s]; the drives' watchdogs are faster."""

RETURNS = 2
"""Maximum number of new time-outs for a drive whose power returns after power-off."""

SHOWN_OFF = frozenset({State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY})
"""States without motion until a command."""

NOT_ENERGISED = SHOWN_OFF | {State.READY_TO_SWITCH_ON}
"""States without power at the motor."""


class StopBound(NamedTuple):
    """Largest distance [increments] and time [s] of an axis after a stop command."""

    way: float
    time: float

    @classmethod
    def compute(
        cls, speed: float, deceleration: float, window: float, age: float = 0.0
    ) -> StopBound:
        """Compute the bound of an axis.

        Parameters
        ----------
        speed, deceleration : float
            Speed at the command, and stated deceleration, positive [increments/s, increments/s^2].
        window : float
            Following error window [increments].
        age : float
            Age of the last position at the command [s].
        """
        braking = STOP_MARGIN * speed / deceleration
        return cls(window + speed * (STOP_DELAY + age + braking / 2), STOP_DELAY + braking)


class StopPhase(enum.Enum):
    """Progress of the stop of an axis."""

    STOPPING = "is commanded to stop"
    SLOWING = "has confirmed the command"
    RESTING = "stands still"
    DISABLING = "is commanded to switch off"
    OFF = "is off"
    UNSEEN = "does not show whether it is off"
    LOST = "does not switch off"
    ADRIFT = "moves although it shows that it is off"


class Shown(enum.Enum):
    """Observation of an axis under stop at a SYNC."""

    NOTHING = "no certain telegram"
    UNDEFINED = "no state of CiA 402"
    OFF = "off"
    OFF_AT_REST = "off, and it stands still"
    READY = "without power, and it keeps its voltage"
    ON = "switched on, not enabled"
    ENABLED = "under power"
    OBEYING = "stopping by itself"
    AT_REST = "stopping by itself, and it stands still"


_BRAKING = frozenset({StopPhase.STOPPING, StopPhase.SLOWING})
AWAITED = _BRAKING | {StopPhase.DISABLING}
"""Phases of an axis that may still be moving under power."""

_SHOWN = dict.fromkeys(SHOWN_OFF, (Shown.OFF, Shown.OFF_AT_REST)) | {
    State.READY_TO_SWITCH_ON: (Shown.READY, Shown.READY),
    State.SWITCHED_ON: (Shown.ON, Shown.ON),
    State.OPERATION_ENABLED: (Shown.ENABLED, Shown.ENABLED),
    State.QUICK_STOP_ACTIVE: (Shown.OBEYING, Shown.AT_REST),
    State.FAULT_REACTION_ACTIVE: (Shown.OBEYING, Shown.AT_REST),
}
"""Observation of a moving axis, and of an axis at standstill, by state."""

_ENDS = {Shown.OFF: StopPhase.OFF, Shown.OFF_AT_REST: StopPhase.OFF}
_UNUSED = {Shown.READY: StopPhase.DISABLING, Shown.ON: StopPhase.DISABLING}
_SLOWS = _ENDS | _UNUSED | {Shown.OBEYING: StopPhase.SLOWING, Shown.AT_REST: StopPhase.RESTING}
_NEXT: dict[StopPhase, dict[Shown, StopPhase]] = {
    StopPhase.STOPPING: _SLOWS,
    StopPhase.SLOWING: _SLOWS,
    StopPhase.RESTING: _ENDS | _UNUSED | {Shown.ENABLED: StopPhase.DISABLING},
    StopPhase.DISABLING: _ENDS,
    StopPhase.OFF: dict.fromkeys(
        (Shown.READY, Shown.ON, Shown.ENABLED, Shown.OBEYING, Shown.AT_REST), StopPhase.DISABLING
    ),
    StopPhase.UNSEEN: _ENDS,
    StopPhase.LOST: _ENDS | {Shown.READY: StopPhase.OFF},
    StopPhase.ADRIFT: {Shown.OFF_AT_REST: StopPhase.OFF},
}
"""Next phase by observation; other observations leave the phase unchanged."""


def next_step(phase: StopPhase, shown: Shown) -> tuple[StopPhase, Command | None]:
    """Return the next phase after an observation, and its command."""
    following = _NEXT[phase].get(shown, phase)
    return following, _command(following, shown)


def _command(phase: StopPhase, shown: Shown) -> Command | None:
    if phase in _BRAKING:
        return None if shown in {Shown.OBEYING, Shown.AT_REST} else Command.QUICK_STOP
    return None if phase is StopPhase.RESTING else Command.DISABLE_VOLTAGE


def overdue_phase(phase: StopPhase, shown: Shown) -> StopPhase:
    """Return the next phase after an exceeded bound."""
    if phase is not StopPhase.DISABLING:
        return StopPhase.DISABLING
    if shown is Shown.READY:
        return StopPhase.OFF  # the drive keeps its voltage, but cannot turn its motor
    return StopPhase.UNSEEN if shown is Shown.NOTHING else StopPhase.LOST


class AxisStop:
    """Stop of an axis.

    Parameters
    ----------
    now : float
        Time of the first stop command [s].
    time : float
        Time of the last position [s].
    position : int
        Last position received [increments].
    speed, deceleration, window : float
        As for `StopBound.compute`.
    rest : Standstill
        Standstill detector of the axis.
    settling : float
        Time of `rest` to be certain [s].
    delay : float
        Time of two SYNCs [s].

    Attributes
    ----------
    phase : StopPhase
        Progress of the stop.
    state : State or None
        State at the last SYNC, None if unknown.
    bound : StopBound
        Largest distance and time of the stop.
    overrun : tuple of float or None
        Distance [increments] and time [s] at which the bound was exceeded.
    left_at : int or None
        Position at the first confirmation of power-off [increments].
    """

    def __init__(
        self,
        now: float,
        time: float,
        position: int,
        *,
        speed: float,
        deceleration: float,
        window: float,
        rest: Standstill,
        settling: float,
        delay: float = 0.0,
    ) -> None:
        self.phase = StopPhase.STOPPING
        self.overrun: tuple[float, float] | None = None
        self.state: State | None = None
        self.left_at: int | None = None
        self._seen, self._origin = time, position
        self._delay = delay
        self._speed, self._deceleration, self._window = speed, deceleration, window
        self._rest, self._settling = rest, settling
        self._asked = self._rested = now
        self._begun: float | None = None
        self._confirmed = False
        self._off_time = OFF_TIME_MOVING
        self._returns = 0
        self.bound = self._bound_at(now)

    @property
    def ended(self) -> bool:
        """True if no further observation is awaited."""
        return self.phase not in AWAITED | {StopPhase.RESTING}

    @property
    def unsent(self) -> Command | None:
        """Command not yet accepted by the bus."""
        if self._begun is not None or self.phase not in AWAITED:
            return None
        return _command(self.phase, Shown.NOTHING)

    def note_sent(self, time: float) -> None:
        """Record that the command of this phase was sent [s]."""
        self._confirmed |= self.phase is StopPhase.OFF
        if self._begun is None:
            self._begun = time
            if self.phase in _BRAKING:
                self.bound = self._bound_at(time)

    def resting_time(self, time: float) -> float:
        """Return the duration of standstill [s], 0 while the axis moves."""
        return time - self._rested if self.phase is StopPhase.RESTING else 0.0

    def disable(self, time: float) -> None:
        """Switch off an axis at rest."""
        if self.phase is StopPhase.RESTING:
            self._enter(StopPhase.DISABLING, time)

    def step(self, time: float, word: int, position: int, *, fresh: bool) -> Command | None:
        """Evaluate a SYNC; return the command to send.

        Parameters
        ----------
        time : float
            Instant of the SYNC [s].
        word, position : int
            Statusword and position of the TPDO [increments].
        fresh : bool
            True if they came with this SYNC; otherwise they are ignored.
        """
        self.state = decode_state(word) if fresh else None
        shown = Shown.UNDEFINED if fresh else Shown.NOTHING
        rests = fresh and self._rest.update(position)
        if self.state is not None:
            shown = _SHOWN[self.state][rests]
        if shown in _ENDS and self.left_at is None:
            self.left_at = position
        before, way = self.phase, abs(position - self._origin)
        self._enter(next_step(before, shown)[0], time)
        stops = self.phase in _BRAKING | {StopPhase.RESTING}
        far = stops and fresh and way > self.bound.way
        if far or self._is_late(time, shown):
            self._enter(overdue_phase(self.phase, shown), time)
        came_back = before is StopPhase.RESTING and shown is Shown.ENABLED
        if came_back or (stops and self.phase is StopPhase.DISABLING):
            self.overrun = (way, time - self._seen) if fresh else None
        if self.phase is StopPhase.OFF and self._confirmed:
            return None  # the last command was to disable the voltage
        return _command(self.phase, shown)

    def hang(self) -> None:
        """Give up a stop that takes too long: it is unknown whether the axis is off."""
        if not self.ended:
            self.phase = StopPhase.UNSEEN

    def give_up(self) -> None:
        """Record motion in spite of confirmed power-off: only standstill ends the stop."""
        self.phase = StopPhase.ADRIFT

    def _enter(self, phase: StopPhase, time: float) -> None:
        if phase is StopPhase.RESTING is not self.phase:
            self._rested = time
        elif phase is StopPhase.DISABLING is not self.phase:
            self._returns += self.phase is StopPhase.OFF
            if self._returns <= RETURNS:
                self._begun, self._asked = None, time  # beyond `RETURNS`, the time-out goes on
            self._off_time = OFF_TIME_MOVING if self.phase in _BRAKING else OFF_TIME
        self.phase = phase

    def _is_late(self, time: float, shown: Shown) -> bool:
        """Return True if the time of this phase is over."""
        if self.phase not in AWAITED:
            return False
        seen, brakes = shown is not Shown.NOTHING, self.phase in _BRAKING
        if self._begun is None and not seen:  # the bus neither accepts nor delivers telegrams
            return time - self._asked > (UNSENT_TIME if brakes else OFF_TIME_MOVING)
        most = self.bound.time if brakes else self._off_time
        if self.phase is StopPhase.STOPPING and seen:
            most = STOP_DELAY
        begun = self._asked if self._begun is None else self._begun
        return time - begun > most + self._settling

    def _bound_at(self, time: float) -> StopBound:
        age = max(0.0, time - self._seen) + self._delay
        return StopBound.compute(self._speed, self._deceleration, self._window, age)
