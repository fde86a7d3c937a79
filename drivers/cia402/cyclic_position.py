"""Cyclic synchronous position mode (CiA 402, mode 8): set-points streamed at every SYNC.

In profile position mode each drive plans its own path; in this mode the master plans the paths of
all axes and sends the next set-point of each right after every SYNC. All set-points act at the next
SYNC. Drives change their mode while the axes rest and are enabled: 607A is first set to the present
command, so that a drive that follows at once does not move. After the end of a stream the last
set-point is repeated, since many drives fault without set-points, until `CyclicPosition.leave`
changes the mode back.

Velocity and torque feed-forward (`drivers.cia402.feed_forward`) is sent before the target of the
same cycle. Offsets left by an earlier master are set to zero before the mode is entered.

The corridor of `drivers.safety.trips` follows from the set-points of the last periods, so it moves
along with the stream. If SYNCs are left out, drives come to rest at the last set-point, and the
path is resumed from there (`drivers.cia402.path`); axes overrun the set-point, and the corridor is
widened accordingly until they are back.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402 import objects
from drivers.cia402.feed_forward import FeedForward
from drivers.cia402.path import MEMORY, STILL, Path, Trapezoid
from drivers.cia402.set_point import ENABLED, standstill_of
from drivers.cia402.states import MODE_TIME, Mode
from drivers.cia402.stop import STOP_MARGIN
from drivers.drive_bus import DriveRefused, MoveFailed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData
    from drivers.drive_bus import Move
    from drivers.safety.trips import Trips

DELAY = 6
"""Longest delay of a drive after its set-points [periods]: one until they act, five for loops and
interpolation."""
GRACE = 2.0
"""Longest time of the axes to come to rest after the last set-point [s]."""
LEAST, LOOKED_AT = 0.02, 60.0
"""Smallest pace of a path, and its averaging time [s]: half a minute of motion may
take 25 minutes; a slower computer will not recover by itself."""


class CyclicPosition:
    """Stream of set-points, if any is under way.

    Parameters
    ----------
    process_data : ProcessData
    axes : sequence of Axis
        Axes in joint order.
    trips : Trips
        Supervision whose corridor moves along.
    period : float
        Time between two SYNCs [s].
    cycle : callable
        Lets one SYNC pass under supervision.
    note : callable, optional
        Receives notes for the operator.

    Attributes
    ----------
    cyclic : bool
        True if the drives are in cyclic synchronous position mode.
    moving : bool
        True until the last set-point is reached.
    path_index : float
        Index of the set-points that act from the last SYNC on, from 0; a fraction where the path is
        slowed down.
    """

    def __init__(
        self,
        process_data: ProcessData,
        axes: Sequence[Axis],
        trips: Trips,
        period: float,
        cycle: Callable[[], object],
        note: Callable[[Iterable[str]], None] = lambda _: None,
    ) -> None:
        self.cyclic = self.moving = False
        self.path_index = 0.0
        self._process_data, self._axes, self._trips = process_data, axes, trips
        self._period, self._cycle, self._note = period, cycle, note
        self._path: Path | None = None
        self._first, self._halting = 0, False
        self._overrun, self._overruns_until = [0.0] * len(axes), -math.inf
        self._stalled = -math.inf
        self._moves: dict[int, tuple[Trapezoid, float]] = {}
        self._points: list[list[int]] = []
        self._feed_forward = FeedForward(process_data, axes)

    def begin(
        self, points: NDArray[np.float64], offsets: NDArray[np.float64] | None = None
    ) -> Path:
        """Start a stream of checked set-points, with feed-forward if given.

        Parameters
        ----------
        points : ndarray, shape (n, n_axes)
            Set-points [rad or m].
        offsets : ndarray, shape (n, n_axes, 3), optional
            See `drivers.cia402.path.Path`.
        """
        scales = [axis.scale for axis in self._axes]
        columns = zip(scales, points.T, strict=True)
        exact = np.column_stack([q / scale.position + scale.zero for scale, q in columns])
        for axis, point in enumerate(np.rint(exact[0]).astype(int).tolist()):
            self._process_data.command(axis, point, ENABLED)
        if not self.cyclic:
            self._enter()
        self._feed_forward.begin(feeding=offsets is not None)
        self._moves.clear()
        path = self._take(exact, offsets)
        self._send()
        return path

    def move(self, moves: Mapping[int, Move]) -> None:
        """Lead axes to targets by trapezoidal velocity profiles, without change for other axes."""
        path = self._path
        if path is None:  # no stream, as after a trip
            positions = self._process_data.positions
            here = [a.scale.position_from_counts(positions[a.index]) for a in self._axes]
            path = self.begin(np.array([here, here]))
        passed = (path.at - self._first) * self._period
        stands, now = path.exact, np.zeros(1)
        led = {a: (t, since + passed) for a, (t, since) in self._moves.items()}
        for axis, move in moves.items():
            scale, per_count = self._axes[axis].scale, self._axes[axis].per_count
            trapezoid, since = led.get(axis, (None, 0.0))
            speed = trapezoid.motion(now + since)[1][0] if trapezoid else 0.0
            target = move.target / scale.position + scale.zero
            profile = (move.velocity / per_count, move.acceleration / per_count)
            led[axis] = (Trapezoid(stands[axis], speed, target, *profile), 0.0)
        self._moves = {a: (t, since) for a, (t, since) in led.items() if since < t.duration}
        longest = max((t.duration - since for t, since in self._moves.values()), default=0.0)
        t = np.arange(math.ceil(longest / self._period) + 2) * np.float64(self._period)
        ahead = np.tile(stands, (len(t), 1))
        for axis, (trapezoid, since) in self._moves.items():
            ahead[:, axis] = trapezoid.motion(t + since)[0]
        recent = self._recent(0)
        points = np.vstack([np.array(recent), ahead]) if recent else ahead
        self._take(points, None).go_on(path, len(recent))
        self._first = len(recent)

    def _take(self, exact: NDArray[np.float64], offsets: NDArray[np.float64] | None) -> Path:
        """Start a new path at its first set-points."""
        points = np.rint(exact).astype(int)
        windows = np.array([round(axis.window) for axis in self._axes])
        late = np.stack([np.roll(points, by, axis=0) for by in range(DELAY + 1)])
        for by in range(DELAY + 1):
            late[by, :by] = points[0]
        self._lows = (late.min(axis=0) - windows).tolist()
        self._highs = (late.max(axis=0) + windows).tolist()
        accelerations = [a.drive.limits.acceleration / a.per_count for a in self._axes]
        self._path = path = Path(exact, accelerations, windows.tolist(), self._period, offsets)
        path.caution = MEMORY - (self._process_data.time - self._stalled)
        self._points, self.moving, self.path_index, self._first = points.tolist(), True, 0.0, 0
        self._halting, self._arrived_late = False, 0.0
        self._looked_at = self._process_data.time, 0.0
        self._rests = [standstill_of(axis, self._period) for axis in self._axes]
        self._patience = round(GRACE / self._period)
        return path

    def advance(self, *, calm: bool = False) -> MoveFailed | None:
        """Send the next set-points, or repeat the last; return a failure if any.

        Parameters
        ----------
        calm : bool
            True to slow the path down to rest; otherwise full pace is resumed.
        """
        path, on_arrival = self._path, self._process_data.on_arrival
        if path is None:
            return None
        if not on_arrival:
            self.path_index = path.at
        arriving = not path.ended
        if arriving:
            path.step(calm=calm or self._halting)
            if self._halting and path.pace == 0.0:
                self._take(np.tile(path.exact, (2, 1)), None)
        self._send()
        if on_arrival:
            self.path_index = path.at
            late = self._process_data.now() - self._process_data.time
            self._arrived_late = max(self._arrived_late, late)
        if arriving:
            return self._judge_pace(path.at)
        return self._judge_rest() if self.moving else None

    def note_late(self, time: float) -> None:
        """Record the delay of a SYNC, and with it of the set-points [s]."""
        if self._path is not None and not self._path.ended:
            self._path.note_late(time)

    def note_left_out(self, late: float) -> None:
        """Record a SYNC left out for a delay of `late` [s]: axes overrun their set-points."""
        path, now = self._path, self._process_data.time
        if late > STILL * self._period:
            self._stalled = now
        if path is None or path.ended:
            return
        overrun, back = path.overrun
        ways = (STOP_MARGIN * overrun).tolist()
        if now < self._overruns_until:
            ways = [max(a, b, key=abs) for a, b in zip(ways, self._overrun, strict=True)]
        self._overrun = ways
        self._overruns_until = max(self._overruns_until, now + STOP_MARGIN * back)
        self._let_pass()

    @property
    def streaming(self) -> bool:
        """True while the axes follow a common path, or come to rest there."""
        return not (self._path is None or self._path.ended) and not self._moves

    def velocity(self, axis: int) -> float:
        """Return the present speed of an axis in the stream [rad/s or m/s], 0 without one."""
        recent = self._recent(2)
        steps = [abs(b[axis] - a[axis]) for a, b in pairwise(recent)]
        return max(steps, default=0) * self._axes[axis].per_count / self._period

    def halt(self, decelerations: Sequence[float]) -> None:
        """End the stream and allow for the stopping distance of a halt.

        Parameters
        ----------
        decelerations : sequence of float, length n_axes
            Decelerations of the drives' halt [rad/s^2 or m/s^2].
        """
        recent = self._recent(1)
        for axis, deceleration in zip(self._axes, decelerations, strict=True):
            speed = self.velocity(axis.index)
            if self.moving and speed:
                here = self._process_data.positions[axis.index]
                distance = STOP_MARGIN * speed**2 / (2 * deceleration)
                step = (recent[-1][axis.index] - recent[0][axis.index]) * axis.scale.position
                target = axis.scale.position_from_counts(here) + float(np.sign(step)) * distance
                self._trips.expect(axis.index, here, target, moving=True)
        self.withdraw()
        self.abandon()

    def brake(self) -> None:
        """Slow the axes down to rest along the path, and hold the rest position."""
        self._halting = self.moving
        self._moves.clear()

    def abandon(self) -> None:
        """End the stream; the drives stay in their mode."""
        self._path, self._points, self.moving = None, [], False
        self._moves.clear()

    def withdraw(self) -> None:
        """Cancel the feed-forward."""
        self._feed_forward.withdraw()

    def give_back(self) -> None:
        """Restore the drives' own feed-forward, before ramps that the drives plan."""
        self._feed_forward.give_back()

    def leave(self) -> None:
        """Change back to profile position mode; the axes rest.

        Raises
        ------
        DriveRefused
            A drive does not change its mode.
        """
        self.withdraw()
        self.give_back()
        self.abandon()
        for axis, position in enumerate(self._process_data.positions):
            self._process_data.command(axis, position, ENABLED)
        self._change(Mode.PROFILE_POSITION)
        self.cyclic = False

    def _enter(self) -> None:
        for server in (axis.server for axis in self._axes):
            supported = server.find(objects.SUPPORTED_MODES)
            if supported is not None and not supported & Mode.CYCLIC_POSITION.supported_bit:
                raise DriveRefused(
                    f"{server.label}: no cyclic synchronous position mode (6502 = {supported:08X}h,"
                    " bit 7 is clear), so no trajectory can be streamed to it; plan measurements"
                    " of strokes instead, or use a drive or firmware that has it"
                )
            # the period as mantissa (8 bits) and power of ten (60C2)
            mantissa, power = round(1e6 * self._period), -6
            while mantissa % 10 == 0 or mantissa > 255:
                mantissa, power = round(mantissa / 10), power + 1
            unknown = "its own interpolation time is used"
            server.set_if_present(objects.INTERPOLATION_PERIOD, mantissa, unknown)
            server.set_if_present(objects.INTERPOLATION_POWER, power, unknown)
            for entry in objects.OFFSETS:
                if server.find(entry):
                    server.put(entry, 0)
        self._change(Mode.CYCLIC_POSITION)
        self.cyclic = True

    def _change(self, mode: Mode) -> None:
        servers = [axis.server for axis in self._axes]
        for server in servers:
            server.put(objects.MODE, mode)
        for _ in range(round(MODE_TIME / self._period)):
            slow = [s for s in servers if s.get(objects.MODE_DISPLAY) != mode]
            if not slow:
                return
            self._cycle()
        raise DriveRefused(
            f"{slow[0].label}: does not take mode {mode.value}: 6061 shows"
            f" {slow[0].get(objects.MODE_DISPLAY)}, {MODE_TIME:g} s after it was written to 6060;"
            " release it from the maker's tool or from another master"
        )

    def _recent(self, beyond: int) -> list[list[int]]:
        """Return the set-points of the last periods, and `beyond` set-points from now on."""
        here = 0 if self._path is None else math.ceil(self._path.at)
        return self._points[max(0, here - DELAY) : here + beyond]

    def _send(self) -> None:
        path = self._path
        assert path is not None  # noqa: S101 - by the callers
        data, fed = self._process_data, self._feed_forward.wanted and path.fed
        for axis, target in enumerate(path.targets):
            if fed:
                data.feed_forward(axis, *fed[axis])
            data.lead(axis, target)
        self._let_pass()

    def _let_pass(self) -> None:
        """Move the corridor along with the path."""
        path = self._path
        assert path is not None  # noqa: S101 - by the callers
        before, after = math.floor(path.at), math.ceil(path.at)
        lows, highs = self._lows[after], self._highs[after]
        if before != after:
            lows = list(map(min, self._lows[before], lows))
            highs = list(map(max, self._highs[before], highs))
        if self._process_data.time < self._overruns_until:
            overrun = self._overrun
            lows = [low + min(way, 0) for low, way in zip(lows, overrun, strict=True)]
            highs = [high + max(way, 0) for high, way in zip(highs, overrun, strict=True)]
        self._trips.follow(lows, highs)

    def _judge_pace(self, at: float) -> MoveFailed | None:
        """Return a failure if the path has hardly advanced for `LOOKED_AT`."""
        since, then = self._looked_at
        elapsed = self._process_data.time - since
        if elapsed < LOOKED_AT:
            return None
        self._looked_at = self._process_data.time, at
        pace = (at - then) * self._period / elapsed
        if pace >= LEAST:
            return None
        return MoveFailed(
            f"path passed at {pace:.2%} of its nominal speed for {elapsed:.0f} s, at least "
            f"{LEAST:.0%} needed: late set-points or missing telegrams; stop other programs, run "
            "with --realtime, sample more slowly, or check the wiring"
        )

    def _judge_rest(self) -> MoveFailed | None:
        """Return a failure if the axes do not come to rest in time after the last set-point."""
        path = self._path
        assert path is not None  # noqa: S101 - by the caller
        positions, targets = self._process_data.positions, self._points[-1]
        resting = [r.update(p) for r, p in zip(self._rests, positions, strict=True)]
        off = [
            axis
            for axis, rest in enumerate(self._rests)
            if not resting[axis] or abs(positions[axis] - targets[axis]) > 2 * rest.band
        ]
        self.moving = bool(off)
        self._patience -= 1
        if off and self._patience < 0:
            return MoveFailed(
                f"{self._axes[off[0]].label}: not at rest at the end of its path after"
                f" {GRACE:g} s; check brake, load and position_window"
            )
        if not off and path.slowed:
            self._note([
                f"path slowed down for {path.slowed * self._period:.2g} s, because this computer "
                "was late: stop other programs, run with --realtime, or sample more slowly"
            ])  # fmt: skip
        if not off and self._process_data.on_arrival:
            labels = ", ".join(self._axes[axis].label for axis in self._process_data.on_arrival)
            self._note([
                f"{labels}: set-points acted on arrival, up to {1e3 * self._arrived_late:.2g} ms "
                "after SYNC on this path"
            ])  # fmt: skip
        return None
