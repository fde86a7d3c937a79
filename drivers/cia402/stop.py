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
does not show that its voltage is off in time is lost: nothing but its own watchdog ends it.

Positions are in increments; nothing here sends or waits: `AxisStop.step` takes what one SYNC
showed.
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

_OBEYING = frozenset({State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE})
_UNUSED = frozenset({State.READY_TO_SWITCH_ON, State.SWITCHED_ON})


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
    RESTING = "stands still"
    DISABLING = "is commanded to switch off"
    OFF = "is off"
    UNSEEN = "does not show whether it is off"
    LOST = "does not switch off"


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
        self._seen, self._origin = time, position
        self._delay = delay
        self._speed, self._deceleration, self._window = speed, deceleration, window
        self._rest = rest
        self._settling = settling
        self._begun: float | None = None
        self._asked = now
        self._moving = True
        self._confirmed = self._adrift = self._obeyed = False
        self.left_at: int | None = None
        self._returns = 0
        self._rested = now
        self._bound = self._bound_at(now)

    @property
    def ended(self) -> bool:
        """Nothing is to be commanded any more."""
        return self.phase in {StopPhase.OFF, StopPhase.UNSEEN, StopPhase.LOST}

    @property
    def bound(self) -> StopBound:
        """How far and for how long it may go on."""
        return self._bound

    @property
    def unsent(self) -> Command | None:
        """What the bus has not taken yet."""
        if self._begun is not None:
            return None
        return {
            StopPhase.STOPPING: Command.QUICK_STOP,
            StopPhase.DISABLING: Command.DISABLE_VOLTAGE,
        }.get(self.phase)

    def sent(self, time: float) -> None:
        """Take note that the command of this phase went out [s]."""
        self._confirmed |= self.phase is StopPhase.OFF
        if self._begun is None:
            self._begun = time
            if self.phase is StopPhase.STOPPING:
                self._bound = self._bound_at(time)

    def rested(self, time: float) -> float:
        """Return for how long it has been standing still [s], 0 while it moves."""
        return time - self._rested if self.phase is StopPhase.RESTING else 0.0

    def disable(self, time: float) -> None:
        """Go on to switching off, unless that was reached already."""
        if self.phase in {StopPhase.STOPPING, StopPhase.RESTING, StopPhase.OFF}:
            self._returns += self.phase is StopPhase.OFF
            if self._returns <= RETURNS:
                self._begun, self._asked = None, time  # else the time that has passed counts
            self._moving = self.phase is StopPhase.STOPPING
            self.phase = StopPhase.DISABLING

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
        if self.state in SHOWN_OFF:
            self._take_off(position)
        elif self.state in _UNUSED or (self.state and self.phase is StopPhase.OFF):
            self.disable(time)
        elif self.phase in {StopPhase.STOPPING, StopPhase.RESTING}:
            self._watch(time, position, fresh=fresh)
        if self.phase is StopPhase.DISABLING:
            self._await_off(time, fresh=fresh)
        match self.phase:
            case StopPhase.STOPPING if self.state not in _OBEYING:
                return Command.QUICK_STOP
            case StopPhase.DISABLING:
                return Command.DISABLE_VOLTAGE
            case StopPhase.OFF if (
                not self._confirmed
            ):  # the last word is never that of a quick stop
                return Command.DISABLE_VOLTAGE
        return None

    def hang(self) -> None:
        """Give up what takes too long: it does not show any more whether it is off."""
        if not self.ended:
            self.phase = StopPhase.UNSEEN

    def give_up(self) -> None:
        """Take note that it moves although it shows that it is off: only standstill counts now."""
        self._adrift, self.phase = True, StopPhase.LOST

    def _take_off(self, position: int) -> None:
        if self.left_at is None:
            self.left_at = position
        if not self._adrift or self._rest.update(position):
            self.phase, self._adrift = StopPhase.OFF, False

    def _watch(self, time: float, position: int, *, fresh: bool) -> None:
        way = abs(position - self._origin)
        rests = fresh and self._rest.update(position) and self.state in _OBEYING
        if rests and self.phase is StopPhase.STOPPING:
            self.phase, self._rested = StopPhase.RESTING, time
        came_back = self.phase is StopPhase.RESTING and self.state is State.OPERATION_ENABLED
        self._obeyed |= self.state in _OBEYING
        deaf = fresh and not self._obeyed
        patience = STOP_DELAY if deaf else self._bound.time
        late = self.phase is StopPhase.STOPPING and self._overdue(time, patience, fresh=fresh)
        far = fresh and way > self._bound.way
        if late or far or came_back:
            self.overrun = (way, time - self._seen) if fresh else None
            self.disable(time)

    def _await_off(self, time: float, *, fresh: bool) -> None:
        if not self._overdue(time, OFF_TIME_MOVING if self._moving else OFF_TIME, fresh=fresh):
            return
        if self.state is State.READY_TO_SWITCH_ON:
            self.phase = StopPhase.OFF  # it keeps its voltage, and cannot turn its motor
        else:
            self.phase = StopPhase.LOST if fresh else StopPhase.UNSEEN

    def _overdue(self, time: float, bound: float, *, fresh: bool) -> bool:
        if self._begun is None and not fresh:  # the bus takes nothing and brings nothing
            unsent = UNSENT_TIME if self.phase is StopPhase.STOPPING else OFF_TIME_MOVING
            return time - self._asked > unsent
        begun = self._asked if self._begun is None else self._begun
        return time - begun > bound + self._settling

    def _bound_at(self, time: float) -> StopBound:
        age = max(0.0, time - self._seen) + self._delay
        return StopBound.of(self._speed, self._deceleration, self._window, age)
