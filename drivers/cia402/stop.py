"""Stopping one axis: quick stop, standstill, voltage off; each step shown by its drive, or bounded.

A command may be lost, ignored, or acknowledged without effect. So each step is commanded anew at
every SYNC until the drive shows that it obeys, and each has a bound. After a quick stop an axis of
speed v and deceleration a may go on for at most::

    way  = window + v (STOP_DELAY + age) + STOP_MARGIN v^2 / (2 a)
    time = STOP_DELAY + STOP_MARGIN v / a  (and until standstill is certain)

where window is its following error window and age how old its last position was when the command
went out, and two SYNCs, for some drives act with the next one. Beyond either bound its voltage is
disabled at once, and so it is if the drive does not even show within STOP_DELAY that it stops. That
holds too where it is seen that nothing happens although the bus refuses the command. A drive that
does not show that its voltage is off in time is lost: what ends it is its own watchdog, but it is
commanded on to switch off.

What follows from what a drive shows is one table (`step_of`), and what from a bound that is passed
another (`overdue`). Positions are in increments; nothing here sends or waits: `AxisStop.step` takes
what one SYNC showed.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, NamedTuple

from drivers.cia402.states import Command, State, decode_state

if TYPE_CHECKING:
    from drivers.cia402.set_point import Standstill

STOP_DELAY = 0.1
"""Time that a drive may take to begin to slow down, and its loops to follow [s]."""

STOP_MARGIN = 1.5
"""Factor by which a stop may last longer and go farther than its stated deceleration says."""

OFF_TIME = 0.5
"""How long a drive at rest may take to switch off [s]; it may close a brake first."""

OFF_TIME_MOVING = 0.2
"""The same for an axis that did not stop as it should [s]."""

UNSENT_TIME = 2.0
"""How long a command is tried that the bus does not take [s]; the drives' watchdogs are faster."""

RETURNS = 2
"""How often a drive that was off and shows power again is given time anew to switch off."""

SHOWN_OFF = frozenset({State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY})
"""States in which a drive cannot turn its motor until it is commanded to."""

NOT_ENERGISED = SHOWN_OFF | {State.READY_TO_SWITCH_ON}
"""States in which the motor has no power."""


class StopBound(NamedTuple):
    """How far [increments] and for how long [s] an axis may go on after a stop command."""

    way: float
    time: float

    @classmethod
    def of(cls, speed: float, deceleration: float, window: float, age: float = 0.0) -> StopBound:
        """Return the bound of an axis.

        Parameters
        ----------
        speed, deceleration : float
            At the command, and as stated, both positive [increments/s, increments/s^2].
        window : float
            Following error window [increments].
        age : float
            Of the last position when the command went out [s].
        """
        braking = STOP_MARGIN * speed / deceleration
        return cls(window + speed * (STOP_DELAY + age + braking / 2), STOP_DELAY + braking)


class StopPhase(enum.Enum):
    """How far the stop of an axis has come."""

    STOPPING = "is commanded to stop"
    SLOWING = "has shown that it obeys"
    RESTING = "stands still"
    DISABLING = "is commanded to switch off"
    OFF = "is off"
    UNSEEN = "does not show whether it is off"
    LOST = "does not switch off"
    ADRIFT = "moves although it shows that it is off"


class Shown(enum.Enum):
    """What one SYNC shows of an axis that shall stop."""

    NOTHING = "no telegram that is certain"
    UNDEFINED = "no state of the standard"
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
"""What a state shows of an axis that moves, and of one that stands still."""

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
"""What follows from what is shown; all else leaves the phase as it is."""


def step_of(phase: StopPhase, shown: Shown) -> tuple[StopPhase, Command | None]:
    """Return the phase that follows from what is shown, and what is commanded in it."""
    following = _NEXT[phase].get(shown, phase)
    return following, _command(following, shown)


def _command(phase: StopPhase, shown: Shown) -> Command | None:
    if phase in _BRAKING:
        return None if shown in {Shown.OBEYING, Shown.AT_REST} else Command.QUICK_STOP
    return None if phase is StopPhase.RESTING else Command.DISABLE_VOLTAGE


def overdue(phase: StopPhase, shown: Shown) -> StopPhase:
    """Return the phase that follows where the bound of `phase` is passed."""
    if phase is not StopPhase.DISABLING:
        return StopPhase.DISABLING
    if shown is Shown.READY:
        return StopPhase.OFF  # it keeps its voltage, and cannot turn its motor
    return StopPhase.UNSEEN if shown is Shown.NOTHING else StopPhase.LOST


class AxisStop:
    """The stop of one axis.

    Parameters
    ----------
    now : float
        When it is first commanded to stop [s].
    time : float
        Of its last position [s].
    position : int
        The last that was received [increments].
    speed, deceleration, window : float
        As for `StopBound.of`.
    rest : Standstill
        Judges whether it rests.
    settling : float
        How long `rest` takes to be certain [s].
    delay : float
        Time of two SYNCs [s].

    Attributes
    ----------
    phase : StopPhase
        How far it has come.
    state : State or None
        What it showed at the last SYNC, None where that is unknown.
    bound : StopBound
        How far and for how long it may go on.
    overrun : tuple of float or None
        Way [increments] and time [s] at which it was seen to exceed its bound.
    left_at : int or None
        Where it was when it first showed that it is off [increments].
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
        self._rest = rest
        self._settling = settling
        self._asked = self._rested = now
        self._begun: float | None = None
        self._confirmed = False
        self._off_time = OFF_TIME_MOVING
        self._returns = 0
        self.bound = self._bound_at(now)

    @property
    def ended(self) -> bool:
        """Nothing is to be awaited any more."""
        return self.phase not in AWAITED | {StopPhase.RESTING}

    @property
    def unsent(self) -> Command | None:
        """What the bus has not taken yet."""
        if self._begun is not None or self.phase not in AWAITED:
            return None
        return _command(self.phase, Shown.NOTHING)

    def sent(self, time: float) -> None:
        """Take note that the command of this phase went out [s]."""
        self._confirmed |= self.phase is StopPhase.OFF
        if self._begun is None:
            self._begun = time
            if self.phase in _BRAKING:
                self.bound = self._bound_at(time)

    def rested(self, time: float) -> float:
        """Return for how long it has been standing still [s], 0 while it moves."""
        return time - self._rested if self.phase is StopPhase.RESTING else 0.0

    def disable(self, time: float) -> None:
        """Switch off an axis that rests."""
        if self.phase is StopPhase.RESTING:
            self._enter(StopPhase.DISABLING, time)

    def step(self, time: float, word: int, position: int, *, fresh: bool) -> Command | None:
        """Take one SYNC; return what to command.

        Parameters
        ----------
        time : float
            The SYNC's instant [s].
        word, position : int
            Statusword and position of its TPDO [increments].
        fresh : bool
            They came with this SYNC; else they say nothing.
        """
        self.state = decode_state(word) if fresh else None
        shown = self._shown(position, fresh=fresh)
        if shown in _ENDS and self.left_at is None:
            self.left_at = position
        before, way = self.phase, abs(position - self._origin)
        self._enter(step_of(before, shown)[0], time)
        stops = self.phase in _BRAKING | {StopPhase.RESTING}
        far = stops and fresh and way > self.bound.way
        if far or self._late(time, shown):
            self._enter(overdue(self.phase, shown), time)
        came_back = before is StopPhase.RESTING and shown is Shown.ENABLED
        if came_back or (stops and self.phase is StopPhase.DISABLING):
            self.overrun = (way, time - self._seen) if fresh else None
        if self.phase is StopPhase.OFF and self._confirmed:
            return None  # the last word was not that of a quick stop
        return _command(self.phase, shown)

    def hang(self) -> None:
        """Give up what takes too long: it does not show any more whether it is off."""
        if not self.ended:
            self.phase = StopPhase.UNSEEN

    def give_up(self) -> None:
        """Take note that it moves although it shows that it is off: only standstill counts now."""
        self.phase = StopPhase.ADRIFT

    def _shown(self, position: int, *, fresh: bool) -> Shown:
        if not fresh:
            return Shown.NOTHING
        rests = self._rest.update(position)
        return Shown.UNDEFINED if self.state is None else _SHOWN[self.state][rests]

    def _enter(self, phase: StopPhase, time: float) -> None:
        if phase is StopPhase.RESTING is not self.phase:
            self._rested = time
        elif phase is StopPhase.DISABLING is not self.phase:
            self._returns += self.phase is StopPhase.OFF
            if self._returns <= RETURNS:
                self._begun, self._asked = None, time  # else the time that has passed counts
            self._off_time = OFF_TIME_MOVING if self.phase in _BRAKING else OFF_TIME
        self.phase = phase

    def _late(self, time: float, shown: Shown) -> bool:
        """Whether the time of this phase is over."""
        if self.phase not in AWAITED:
            return False
        seen, brakes = shown is not Shown.NOTHING, self.phase in _BRAKING
        if self._begun is None and not seen:  # the bus takes nothing and brings nothing
            return time - self._asked > (UNSENT_TIME if brakes else OFF_TIME_MOVING)
        most = self.bound.time if brakes else self._off_time
        if self.phase is StopPhase.STOPPING and seen:
            most = STOP_DELAY
        begun = self._asked if self._begun is None else self._begun
        return time - begun > most + self._settling

    def _bound_at(self, time: float) -> StopBound:
        age = max(0.0, time - self._seen) + self._delay
        return StopBound.of(self._speed, self._deceleration, self._window, age)
