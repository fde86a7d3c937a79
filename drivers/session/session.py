"""Session of checked and configured axes, from power-on to the stop.

A `Session` is built once every drive has passed. Time passes in `sample` only: one SYNC, its
answers, set-point handshakes, heartbeats, statuswords and emergencies. A failure stops all axes
before it is raised, and latches. The end of a session is in `drivers.session.servo_axes`.
"""

from __future__ import annotations

import enum
import math
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from drivers.axis import unwrap_positions
from drivers.cia402.cyclic_position import CyclicPosition
from drivers.cia402.feed_forward import offsets_in_counts
from drivers.cia402.profile_position import ProfilePosition
from drivers.cia402.samples import SampleReader
from drivers.cia402.set_point_limits import (
    check_feed_forward,
    check_move,
    check_path,
    refuse_outside,
)
from drivers.cia402.states import State
from drivers.drive_bus import LATE_FOR, DriveError, DriveRefused, MoveFailed, Tripped
from drivers.safety.current_offset import measure_offsets
from drivers.safety.trips import MissingTelegrams, Trips
from drivers.session.stopping import Stopping

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from drivers.axis import Axis
    from drivers.drive_bus import Move, Sample
    from drivers.session.connection import Connection

LEFT_OUT = 0.5
"""Delay of a SYNC beyond which a SYNC was left out [periods]: the tolerance of deadlines."""
UNSUPERVISED = 0.5
"""Longest time without supervision during motion, as a share of the heartbeat timeout."""

AHEAD = 25
"""Largest number of SYNCs in lock-step between two checks of the axes: 0.1 s at 4 ms, which a
waiting plant does not notice."""
ROUNDED = 0.01
"""Rounding error of sums of periods, as a share of a period."""


class SessionState(enum.Enum):
    """Progress of a session."""

    CHECKED = "all drives are checked; no drive exchanges process data"
    READY = "all drives exchange process data"
    STOPPED = "all axes are stopped, until a deliberate reset"
    LEFT = "axes stopped, drives off and restored, as far as possible"


class Session:
    """Axes under power, their motion and supervision.

    Parameters
    ----------
    connection : Connection
        Connection to checked and configured drives.
    period : float
        Time between two SYNCs [s].
    axes : tuple of Axis
        Axes in joint order.
    note : callable
        Receives messages for the operator that stop nothing.
    anywhere : bool
        True to power on even if an axis is outside its limits.
    feed_forward : bool
        True if the drives were set up for offsets of velocity and torque.

    Attributes
    ----------
    axes, connection
        As given.
    stopping : Stopping
        Stop of all axes, with its reason.
    """

    def __init__(
        self,
        connection: Connection,
        period: float,
        axes: tuple[Axis, ...],
        note: Callable[[Iterable[str]], None],
        *,
        anywhere: bool,
        feed_forward: bool = False,
    ) -> None:
        self._state = SessionState.CHECKED
        self.connection, self.axes, self._period = connection, axes, period
        self._note, self._anywhere, self._feed_forward = note, anywhere, feed_forward
        self._planned = any(axis.planned for axis in axes)
        connection.process_data = unwrap_positions(connection.process_data, axes)
        self._process_data = data = connection.process_data
        self._life_sign, self._power = connection.life_sign, connection.power
        self._supervision = connection.supervision
        self._unsupervised = max(UNSUPERVISED * connection.life_sign.timeout, 3 * period)
        self._words: Sequence[int] = ()
        self._late, self._rested = (-math.inf, 0.0), -math.inf
        self._profiles: dict[int, tuple[float, float]] = {}
        self._samples = SampleReader(axes)
        self._missing = MissingTelegrams(
            axes,
            connection.collect_late,
            period,
            connection.silence,
            connection.wiring,
            connection.doubling,
        )
        self._profile_position = profile = ProfilePosition(data, axes, period)
        self._trips = Trips(axes, period)
        self._cyclic_position = cyclic = CyclicPosition(
            data, axes, self._trips, period, self.follow, note
        )
        self.stopping = Stopping(connection, axes, period, profile, cyclic)

    @property
    def state(self) -> SessionState:
        """Progress of the session."""
        stopped = self._state is SessionState.READY and self.stopping.trip is not None
        return SessionState.STOPPED if stopped else self._state

    @property
    def looks_ahead(self) -> bool:
        """True if `samples` may return several samples."""
        return self._process_data.looks_ahead

    def leave(self) -> None:
        """Record the end of the session: nothing can be commanded any more."""
        self._state = SessionState.LEFT

    def start(self) -> None:
        """Start process data and power all axes on.

        Raises
        ------
        DriveRefused, LimitExceeded, NodeSilent, DriveFault, BusUnavailable
            The axes cannot be powered on.
        """
        self.connection.start()
        self._state = SessionState.READY
        self.connection.await_answers()
        self.power_on()

    def power_on(self) -> None:
        """Energise the axes together at the present positions."""
        self.connection.refuse_unwatched()
        if not self._anywhere:
            refuse_outside(self.axes, self._process_data.positions)
        self._power.walk(State.SWITCHED_ON, self.connection.cycle)
        self.note_offsets("before power-on")
        self._power.walk(State.OPERATION_ENABLED, self.connection.cycle)
        self._process_data.skipped = 0
        self._trips.arm(self._process_data.now(), self._process_data.positions)
        if self._planned:
            here = self._samples.sample(
                self._process_data.now(), self._process_data, reached=True
            ).q
            self._cyclic_position.begin(np.array([here, here]))
            while self._cyclic_position.moving:
                self.sample()

    def move(self, moves: Mapping[int, Move]) -> None:
        """Send set-points to axes and return at once (see `drivers.drive_bus.DriveBus`)."""
        self.stopping.refuse()
        if self._planned and self._cyclic_position.streaming:
            raise MoveFailed("no move can begin while a path is streamed; wait for its end")
        for axis, move in moves.items():
            check_move(move, self.axes[axis])
        try:
            profiles = {axis: (move.velocity, move.acceleration) for axis, move in moves.items()}
            equal = profiles.items() <= self._profiles.items()
            if not self._moving and not (equal and self.connection.requests_delay):
                self.connection.look_at_limits()
            self._profiles |= profiles
            self._rested = self._rested if self._moving else self._process_data.now()
            if self._planned:
                return self._cyclic_position.move(moves)
            if self._cyclic_position.cyclic:
                self._cyclic_position.leave()
            for axis, move in moves.items():
                moving = axis in self._profile_position.active
                here = self._process_data.positions[axis]
                self._trips.expect(axis, here, move.target, moving=moving)
            self._profile_position.start(moves)
        except DriveError as error:
            self.stopping.fail(error)
        return None

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Start a path of set-points (see `drivers.drive_bus.StreamingBus`)."""
        self.stopping.refuse()
        if self._moving:
            raise MoveFailed("no path can begin while an axis moves; wait until all axes rest")
        here = self._samples.sample(self._process_data.now(), self._process_data, reached=True).q
        points = np.asarray(path, dtype=float)
        check_path(points, self.axes, here, self._period)
        offsets, stated = None, (velocity, torque, holding)
        if any(values is not None for values in stated):
            if not self._feed_forward:
                raise DriveRefused(
                    "the drives were not set up for feed-forward; open the bus with "
                    "feed_forward=True"
                )
            fed = [
                np.zeros_like(points) if values is None else np.asarray(values, dtype=float)
                for values in stated
            ]
            check_feed_forward(points, fed, self.axes, self._period)
            offsets = offsets_in_counts(fed, self.axes)
        try:
            self._cyclic_position.begin(points, offsets)
        except DriveError as error:
            self.stopping.fail(error)

    def sample(self) -> Sample:
        """Return the sample of the next SYNC (see `drivers.drive_bus.DriveBus`)."""
        return self._step(1)[-1]

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return the samples of the next SYNCs (see `drivers.drive_bus.DriveBus`)."""
        data, profile = self._process_data, self._profile_position
        if (  # the next SYNC needs an action
            self._cyclic_position.cyclic
            or self._missing.open
            or data.words != self._words
            or self._supervision.emergency
            or self._life_sign.trouble
        ):
            return self._step(1)
        until = min(self._life_sign.due, profile.quiet_until(data.words))
        # the last SYNC is checked separately
        times = (until - data.time) / self._period + 1 - ROUNDED
        return self._step(int(max(1.0, min(limit, AHEAD, times))))

    def _step(self, limit: int) -> Sequence[Sample]:
        """Let up to `limit` SYNCs pass; check all of them, and the last completely."""
        if self.stopping.trip is not None:
            self.stopping.supervise()
            self.stopping.refuse()
        data, limits, reached = self._process_data, self._samples.limits, not self._moving
        before = data.time
        try:
            cycles, time = data.sync_ahead(limit), data.time
            if cycles is not None:
                before = cycles.times[-1]
                self._profile_position.pass_by(cycles)
                tripped = self._trips.look_ahead(cycles)
                if tripped:
                    self._fail(tripped)
            self._judge(time, time - before)
        except DriveError as error:
            self.stopping.fail(error)
        last = self._samples.sample(time, data, not self._moving)
        ahead = self._samples.convert_several(cycles, limits, reached) if cycles else ()
        return [*ahead, last]

    def _judge(self, time: float, elapsed: float) -> None:
        """Check the SYNC at `time`, `elapsed` after the previous SYNC [s]."""
        data, profile, cyclic = self._process_data, self._profile_position, self._cyclic_position
        if elapsed > self._period:
            late = elapsed - self._period
            if late > LEFT_OUT * self._period:
                self._late = data.time, elapsed
                cyclic.note_left_out(late)
            cyclic.note_late(late)
        if time >= self._life_sign.due:
            self._life_sign.service()
        words = data.words
        if words != self._words or self._supervision.emergency or self._life_sign.trouble:
            self._attend(words)
        if data.irregular or self._missing.open:
            busy = time - self._late[0] <= LATE_FOR
            blind = self._missing.look(data.flags, data.misfits, busy=busy)
            if blind:
                self._fail(blind)
        # requests before a move may take longer: the axes rest meanwhile
        if min(elapsed, time - self._rested) > self._unsupervised and profile.active:
            self.stopping.fail(
                Tripped(
                    f"axes in motion were not supervised for {elapsed:.3g} s, at most "
                    f"{self._unsupervised:.3g} s allowed (half the heartbeat timeout); call "
                    "sample() sooner, or stop other programs"
                )
            )
        failed = (
            (profile.active and profile.advance(time, data))
            or self._trips.look(time, data)
            or (cyclic.cyclic and cyclic.advance(calm=self._missing.blind))
        )
        if failed:
            self._fail(failed)

    def follow(self) -> Sample:
        """Return the next sample of a motion planned by a drive, such as homing.

        Statuswords, emergencies and heartbeats are supervised as in `sample`; the path is not,
        since only the drive knows it.
        """
        if self.stopping.trip is not None:
            self.stopping.supervise()
            self.stopping.refuse()
        try:
            time = self._process_data.sync()
            self._life_sign.service()
            self._attend(self._process_data.words)
        except DriveError as error:
            self.stopping.fail(error)
        self._trips.arm(time, self._process_data.positions)
        return self._samples.sample(time, self._process_data, reached=False)

    def halt(self) -> None:
        """Stop every axis with the profile deceleration; the drives stay powered."""
        self.stopping.refuse()
        if self._planned:
            return self._cyclic_position.brake()
        try:
            profile = self._profile_position
            decelerations = [profile.deceleration(axis) for axis in range(len(self.axes))]
            self._cyclic_position.halt(decelerations)
            profile.halt()
            self._cyclic_position.give_back()
        except DriveError as error:
            self.stopping.fail(error)
        return None

    def reset(self) -> None:
        """Power the axes on again after a trip (see `drivers.drive_bus.DriveBus`)."""
        if self.stopping.trip is None:
            return
        self.stopping.end(self._note)
        self._life_sign.watch()
        self._supervision.forget()
        self._words = ()
        try:
            for server in self.connection.servers:
                self._power.make_safe(server, reset_fault=True)
            self.connection.cycle()
            self.power_on()
        except DriveError as error:
            self.stopping.fail(error)

    def note_offsets(self, when: str) -> None:
        """Note offsets of current sensors, with all power stages off."""
        self._note(
            measure_offsets(self._process_data, self.axes, self.connection.beating_cycle, when)
        )

    @property
    def path_index(self) -> float:
        """Index of the set-points that act from the last SYNC on, from 0."""
        return self._cyclic_position.path_index

    @property
    def _moving(self) -> bool:
        return bool(self._profile_position.active) or self._cyclic_position.moving

    def _attend(self, words: Sequence[int]) -> None:
        self._words = words
        self._samples.note_limits(words)
        if self._life_sign.trouble:
            self.stopping.fail(self._life_sign.trouble)
        lost = self._supervision.find_lost(words)
        if lost is not None:
            self.stopping.stop()
            self.stopping.await_rest()  # before the drive is asked for the reason
            self._fail(self._supervision.diagnose(self.axes[lost].server, words[lost]))
        self._note(self._supervision.warnings())

    def _fail(self, trouble: DriveError) -> NoReturn:
        """Stop all axes; a preceding delay of SYNC comes first in the message."""
        at, gap = self._late
        ago = self._process_data.now() - at
        if ago <= LATE_FOR:
            trouble = type(trouble)(
                f"{1e3 * ago:.2g} ms earlier a SYNC was {1e3 * gap:.3g} ms after the previous "
                f"one instead of {1e3 * self._period:.3g} ms: this computer was late; stop other "
                f"programs or use --realtime first; then: {trouble}"
            )
        self.stopping.fail(trouble)
