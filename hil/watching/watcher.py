"""Alarms from judged samples, and statistics of the visibility of pushes.

Samples come from recordings, or from a watched bus with any motion. Torques are traced around
alarms, or at the end without an alarm.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from drivers.drive_bus import Tripped
from hil.measuring.feeding import BusInFront
from hil.results.watch import LATE, SOON, STRONG, WEAK, Alarm, Sight, Watched
from hil.watching.detector import Detector, Judged

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drive_bus import DriveBus, Sample
    from hil.arrays import Array
    from hil.results.model import Model


class TraceStretch(NamedTuple):
    """Torques of an axis over a short time.

    Attributes
    ----------
    alarm : float
        Instant of an alarm; NaN without one [s].
    time, measured, predicted, threshold : ndarray, shape (n,)
        End of a window [s], and mean torques in the window [N m or N]; the threshold is infinite if
        no push is visible.
    """

    alarm: float
    time: Array
    measured: Array
    predicted: Array
    threshold: Array


class Trace:
    """Buffer of the last samples, and traces around the first alarm of every axis.

    Accelerations from encoders, and the direction of friction near a standstill, are far too noisy
    for single samples. Therefore the buffer holds means over the window of the threshold.

    Parameters
    ----------
    period : float
        Time between two samples [s].
    window : int
        Length of the window [samples].
    shown, after : float
        Displayed time, and the part after the alarm [s].
    """

    def __init__(
        self, n_joints: int, period: float, window: int, shown: float = 1.0, after: float = 0.6
    ) -> None:
        self._length, self._after = round(shown / period) + window - 1, after
        self._window = window
        self._last: tuple[Array, ...] = (np.empty(0), *[np.empty((0, n_joints))] * 3)
        self._period = period
        self._n = n_joints
        self._wanted: dict[int, float] = {}
        self._kept: dict[int, TraceStretch] = {}

    @property
    def waiting(self) -> bool:
        """True while a trace after an alarm is incomplete."""
        return bool(self._wanted)

    def take(self, judged: Judged, window: int, rows: slice = slice(None)) -> None:
        """Add judged samples, with the threshold of a window."""
        last = slice(-self._length, None)
        self._last = tuple(
            np.concatenate([kept, new[rows]])[last]
            for kept, new in zip(
                self._last,
                (judged.time - self._period, judged.measured, judged.predicted,
                 judged.threshold[:, window]),
                strict=True,
            )
        )  # fmt: skip
        for axis, alarm in tuple(self._wanted.items()):
            if self._last[0][-1] >= alarm + self._after:
                self._kept[axis] = self._stretch(axis, alarm)
                del self._wanted[axis]

    def keep(self, axis: int, alarm: float) -> None:
        """Keep the trace around an axis's first alarm."""
        if axis not in self._kept:
            self._wanted.setdefault(axis, alarm)

    def stretches(self) -> tuple[TraceStretch, ...]:
        """Return a trace per axis; empty without samples."""
        if not len(self._last[0]):
            return ()
        return tuple(
            self._kept.get(axis) or self._stretch(axis, self._wanted.get(axis, float("nan")))
            for axis in range(self._n)
        )

    def _stretch(self, axis: int, alarm: float) -> TraceStretch:
        mean = min(self._window, len(self._last[0]))  # fewer after an early end
        measured, predicted = (
            np.convolve(each[:, axis], np.full(mean, 1 / mean), "valid") for each in self._last[1:3]
        )
        ends = slice(mean - 1, None)
        time, threshold = self._last[0][ends], self._last[3][ends, axis]
        return TraceStretch(alarm, time, measured, predicted, threshold)


APART = 0.04
"""Averaging time of displayed torques [s]: 25 values per second."""
OVER = 0.25
"""Time without a sign after which an alarm ends [s]."""
TOGETHER = APART
"""Time of samples judged together where no alarm stops the axes [s]: that of a displayed value."""
HELD = 500
"""Maximum number of means kept for display: 20 s of motion."""


class Course(NamedTuple):
    """Torques over time, as means over `APART`.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time of the last sample in each mean [s].
    measured, predicted, band : ndarray, shape (n, n_joints)
        Band about the predicted torque with 95 % of the measured means without contact; infinite if
        unknown [N m or N].
    """

    time: Array
    measured: Array
    predicted: Array
    band: Array


class Watcher:
    """Watch over the axes of a robot.

    Parameters
    ----------
    model : Model
        Model with a friction law.
    period : float
        Time between two samples [s].
    learning : float
        Time of motion in which scatter is learned and no alarm raised [s].
    thresholds : sequence of Sight, optional
        Axes of an earlier watch; their thresholds hold from the start, without learning.

    Attributes
    ----------
    alarms : list of Alarm
        All alarms so far; `peak` and `lasted` of present alarms are preliminary.
    trace : Trace
        Torques around alarms.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(
        self, model: Model, period: float, learning: float, thresholds: Sequence[Sight] = ()
    ) -> None:
        self._detector = Detector(model, period)
        self._model, self._robot, self._period = model, model.robot, period
        self._needed = 0 if thresholds else round(learning / period)
        if thresholds:
            self._detector.begin(thresholds)
        n = model.robot.n_joints
        self._lengths = period * self._detector.windows
        # the last sample of a window is known one period later
        self._soon = max(int((self._lengths + period <= SOON + 1e-9).sum()), 1) - 1
        self._late = max(int((self._lengths + period <= LATE + 1e-9).sum()), 1) - 1
        self._mean = max(round(APART / period), 1)
        self._of_mean = int(np.abs(self._detector.windows - self._mean).argmin())
        self._averaged: list[tuple[float, Array, Array, Array]] = []
        self._sums, self._summed = np.zeros((2, n)), 0
        self._open: dict[int, int] = {}
        self._signs = np.full(n, -np.inf)
        self._unseen, self._still, self._judged = np.zeros((2, n)), np.zeros(n), 0
        self._sizes = np.outer((STRONG, WEAK), model.robot.torque_limit)
        self._thresholds: list[Array] = []
        self.alarms: list[Alarm] = []
        self._moved = 0
        self._last: Judged | None = None
        self.trace = Trace(n, period, int(self._detector.windows[self._soon]))

    def take(self, *samples: Sample) -> tuple[Alarm, ...]:
        """Process further samples; return new alarms."""
        columns = zip(*((each.time, each.q, each.tau) for each in samples), strict=True)
        return self.take_all(*map(np.array, columns))

    def take_all(self, time: Array, q: Array, tau: Array) -> tuple[Alarm, ...]:
        """Process further samples, with the same result as in single calls; return new alarms.

        Parameters
        ----------
        time : ndarray, shape (n,)
            Time [s].
        q, tau : ndarray, shape (n, n_joints)
            Positions [rad or m] and torques [N m or N]; NaN for missing samples.
        """
        begun: list[Alarm] = []
        for judged in self._detector.take(time, q, tau):
            self._last = judged
            self._average(judged)
            first = self._learn(judged)
            if first:
                self.trace.take(judged, self._soon, slice(first))
            if first < len(judged.time):
                begun += self._watch(judged.after(first))
        return tuple(begun)

    def course(self) -> Course:
        """Return the averaged samples since the last call; of more than `HELD`, the last ones."""
        held, self._averaged = self._averaged[-HELD:], []
        if not held:
            n = self._robot.n_joints
            return Course(np.empty(0), *np.empty((3, 0, n)))
        return Course(*map(np.array, zip(*held, strict=True)))

    def unit(self, alarm: Alarm) -> str:
        """Return the unit of an alarm's torque."""
        return self._robot.torque_unit(alarm.axis - 1)

    def sights(self) -> tuple[Sight, ...]:
        """Return the sensitivity to pushes on every axis."""
        return tuple(self._sight(axis) for axis in range(self._robot.n_joints))

    @property
    def learned(self) -> float:
        """Time of motion used for learning thresholds [s]."""
        return self._moved * self._period

    @property
    def required(self) -> float:
        """Required time of motion for learning thresholds [s]."""
        return self._needed * self._period

    @property
    def watched(self) -> float:
        """Time since the end of learning [s]."""
        return self._judged * self._period

    @property
    def learning(self) -> bool:
        """True during learning, without alarms."""
        return self._moved < self._needed

    def torques(self) -> Array:
        """Return the present torques, shape (n_joints, 4) [N m or N].

        Columns are measured torque, predicted torque, mean external torque over the longest window,
        and its threshold, which is infinite without visibility; NaN before the first sample.
        """
        if self._last is None:
            return np.full((self._robot.n_joints, 4), np.nan)
        _, measured, predicted, outside, threshold, *_ = (values[-1] for values in self._last)
        return np.column_stack([measured, predicted, outside[self._late], threshold[self._late]])

    def found(self, plan_digest: str, model: str) -> Watched:
        """Return the results so far.

        Parameters
        ----------
        plan_digest, model : str
            Digest of the watched plan, and path of the model's file.
        """
        return Watched(
            robot_digest=self._robot.digest,
            plan_digest=plan_digest,
            model=model,
            model_digest=self._model.digest,
            period=self._period,
            learned=round(self.learned, 6),
            watched=round(self.watched, 6),
            axes=self.sights(),
            alarms=tuple(self.alarms),
        )

    def _average(self, judged: Judged) -> None:
        begin = 0
        while begin < len(judged.time):
            rows = slice(begin, begin + self._mean - self._summed)
            both = judged.measured[rows], judged.predicted[rows]
            self._sums += [each.sum(axis=0) for each in both]
            self._summed += len(both[0])
            begin += len(both[0])
            if self._summed == self._mean:
                last = begin - 1
                band = judged.band[last, self._of_mean]
                self._averaged.append((float(judged.time[last]), *self._sums / self._mean, band))
                self._sums, self._summed = np.zeros_like(self._sums), 0
        if len(self._averaged) > 2 * HELD:
            del self._averaged[:-HELD]

    def _learn(self, judged: Judged) -> int:
        """Return the number of samples used only for learning."""
        if not self.learning:
            return 0
        moved = self._moved + judged.moving.any(axis=1).cumsum()
        number = int(np.searchsorted(moved, self._needed)) + 1
        self._moved = int(moved[:number][-1])
        return min(number, len(moved))

    def _watch(self, judged: Judged) -> list[Alarm]:
        """Start new alarms, continue open alarms, and end alarms without a sign for `OVER`."""
        self._count(judged)
        ratio = np.abs(judged.outside) / judged.threshold
        signs = np.asarray(np.any(ratio >= 1.0, axis=1))
        if not (signs.any() or self._open or self.trace.waiting):
            self.trace.take(judged, self._soon)
            return []
        begun: list[Alarm] = []
        for row in range(len(judged.time)):
            self.trace.take(judged, self._soon, slice(row, row + 1))
            now = float(judged.time[row])
            for axis in np.flatnonzero(signs[row]).tolist():
                self._signs[axis] = now
                if axis in self._open:
                    continue
                self._open[axis] = len(self.alarms)
                window = int(ratio[row, :, axis].argmax())
                torque = float(judged.outside[row, window, axis])
                begun.append(
                    Alarm(
                        axis=axis + 1,
                        time=round(now, 6),
                        torque=torque,
                        threshold=float(judged.threshold[row, window, axis]),
                        window=round(float(self._lengths[window]), 6),
                        peak=torque,
                    )
                )
                self.alarms.append(begun[-1])
                self.trace.keep(axis, now)
            for axis, number in tuple(self._open.items()):
                alarm = self.alarms[number]
                peak = max(alarm.peak, float(judged.outside[row, self._soon, axis]), key=abs)
                lasted = round(float(self._signs[axis]) - alarm.time, 6)
                self.alarms[number] = alarm.model_copy(update={"peak": peak, "lasted": lasted})
                # a quarter of a period: the same sample ends an alarm however times are rounded
                if now - self._signs[axis] > OVER + self._period / 4:
                    del self._open[axis]
        return begun

    def _count(self, judged: Judged, every: int = 8, most: int = 100_000) -> None:
        """Update the visibility statistics, with one in `every` samples for medians."""
        pairs = judged.threshold[:, [self._soon, self._late]]
        self._unseen += (pairs > self._sizes).sum(axis=0)
        self._still += (~judged.moving).sum(axis=0)
        counted = slice(-self._judged % every, None, every)
        self._judged += len(judged.time)
        self._thresholds += list(
            np.where(judged.moving[counted, np.newaxis], pairs[counted], np.nan)
        )
        if len(self._thresholds) > most:
            del self._thresholds[::2]

    def _sight(self, axis: int) -> Sight:
        found = np.array(self._thresholds or [np.full((2, self._robot.n_joints), np.nan)])
        shown = found[~np.isnan(found[:, 0, axis]), :, axis]
        soon, late = np.median(shown, axis=0) if len(shown) else (np.inf, np.inf)
        learned = self._detector.scatter
        rms = learned.rms[:, axis] * self._robot.torque_limit[axis]
        shares = np.array([self._still[axis], *self._unseen[:, axis]]) / max(self._judged, 1)
        still, blind, dim = shares.tolist()
        return Sight(
            axis=axis + 1,
            unit=self._robot.torque_unit(axis),
            limit=float(self._robot.torque_limit[axis]),
            soon=float(soon) if np.isfinite(soon) else None,
            late=float(late) if np.isfinite(late) else None,
            still=still,
            blind=blind,
            dim=dim,
            distance=float(self._detector.distance[axis]),
            scatter=tuple(rms.tolist()),
            moved=float(learned.weights[axis] * self._period),
            reversals=tuple(map(tuple, self._detector.turning.sums[:, :, axis].tolist())),
        )


class WatchingBus(BusInFront):
    """Bus in front of another `drivers.drive_bus.StreamingBus` that watches the samples.

    Parameters
    ----------
    bus : DriveBus
        Bus not entered yet.
    show : callable
        Function called with each new alarm, and with None after every sample without one.
    stop : bool
        True to stop all axes at the first alarm, raised as `Tripped`: leaving the bus with this
        error stops the axes and switches them off.
    at_once : int
        Number of samples judged together, which may be changed during the motion. More samples take
        less computing time for equal results, but delay an alarm until the last sample.
    """

    def __init__(
        self,
        bus: DriveBus,
        watcher: Watcher,
        show: Callable[[Alarm | None], None],
        *,
        stop: bool = False,
        at_once: int = 1,
    ) -> None:
        super().__init__(bus)
        self.at_once = at_once
        self._held: list[Sample] = []
        self._watcher = watcher
        self._show = show
        self._stop = stop

    def sample(self) -> Sample:
        """Wait for the next SYNC, and judge the samples.

        Raises
        ------
        Tripped
            An alarm was raised and the axes must be stopped.
        """
        sample = self._bus.sample()
        self._held.append(sample)
        alarms = self._judge() if len(self._held) >= self.at_once else ()
        if alarms and self._stop:
            raise Tripped(
                f"{describe_alarm(alarms[0], self._watcher.unit(alarms[0]))}; all axes stop"
            )
        for alarm in alarms or (None,):
            self._show(alarm)
        return sample

    def __exit__(self, *raised: Any) -> None:
        """Stop the axes and power off; then judge the last samples."""
        try:
            super().__exit__(*raised)
        finally:
            for alarm in self._judge() if self._held else ():
                self._show(alarm)

    def _judge(self) -> tuple[Alarm, ...]:
        held, self._held = self._held, []
        return self._watcher.take(*held)


def describe_alarm(alarm: Alarm, unit: str) -> str:
    """Describe an alarm: axis, time, size and threshold."""
    return (
        f"axis {alarm.axis}: external torque {alarm.torque:+.3g} {unit} at {alarm.time:.3f} s, "
        f"mean over {1e3 * alarm.window:.0f} ms; threshold {alarm.threshold:.3g} {unit}"
    )
