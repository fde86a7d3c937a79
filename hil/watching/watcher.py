"""Raises alarms from what single samples show, and counts how well each axis was seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.results.watch import LATE, SOON, STRONG, WEAK, Alarm, Sight, Watched
from hil.watching.detector import Detector
from hil.watching.trace import Trace

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.drive_bus import Sample
    from hil.results.model import Model
    from hil.watching.detector import Judged

    Array = NDArray[np.float64]

OVER = 0.25
"""Time without a sign after which an alarm is over [s]."""
EVERY = 8
"""Samples of which one counts for medians."""


class Watcher:
    """Watches all axes.

    Parameters
    ----------
    model : Model
        With a law of friction.
    period : float
        Time between two samples [s].
    learning : float
        Time of motion in which scatter is learned and no alarm raised [s].

    Attributes
    ----------
    alarms : list of Alarm
        All until now; of those that go on, `peak` and `lasted` are of the past.
    learned, watched : float
        Time with an axis in motion until the first alarm may be raised, and time since then [s].
    trace : Trace
        Torques around alarms.

    Raises
    ------
    NotEnoughData
        The model has no law of friction.
    """

    def __init__(self, model: Model, period: float, learning: float) -> None:
        self._detector = Detector(model, period)
        self._robot, self._period, self._learning = model.robot, period, learning
        n = model.robot.n_joints
        self._lengths = period * np.array(self._detector.windows)
        # the last sample of a window is known one period later
        self._soon = max(int((self._lengths + period <= SOON + 1e-9).sum()), 1) - 1
        self._late = max(int((self._lengths + period <= LATE + 1e-9).sum()), 1) - 1
        self._open: dict[int, int] = {}
        self._signs = np.full(n, -np.inf)
        self._unseen, self._judged = np.zeros((2, n)), 0
        self._sizes = np.outer((STRONG, WEAK), model.robot.torque_limit)
        self._thresholds: list[Array] = []
        self.alarms: list[Alarm] = []
        self.learned = self.watched = 0.0
        self._last: Judged | None = None
        self.trace = Trace(n, period)

    def take(self, sample: Sample) -> tuple[Alarm, ...]:
        """Take the next sample; return the alarms that begin with it."""
        judged = self._detector.take(sample)
        if judged is None:
            return ()
        self._last = judged
        self.trace.take(judged, self._soon)
        if self.learning:
            self.learned += self._period * bool(judged.moving.any())
            return ()
        self.watched += self._period
        self._count(judged)
        return self._raised(judged)

    def unit(self, alarm: Alarm) -> str:
        """Unit of an alarm's torque."""
        return self._robot.torque_unit(alarm.axis - 1)

    def sights(self) -> tuple[Sight, ...]:
        """How well each axis was seen."""
        return tuple(self._sight(axis) for axis in range(self._robot.n_joints))

    @property
    def learning(self) -> bool:
        """Whether thresholds are still learned, and no alarm is raised."""
        return self.learned < self._learning

    def torques(self) -> Array:
        """Torques now, shape (n_joints, 4) [N m or N].

        Measured, predicted, mean from outside over the longest window, and its threshold; NaN
        before the first.
        """
        if self._last is None:
            return np.full((self._robot.n_joints, 4), np.nan)
        measured, predicted, outside, threshold = self._last[1:5]
        return np.column_stack([measured, predicted, outside[self._late], threshold[self._late]])

    def found(self, plan_digest: str, model: str) -> Watched:
        """All that was found until now.

        Parameters
        ----------
        plan_digest, model : str
            Of what was watched, and path of the model's file; to be kept.
        """
        return Watched(
            robot_digest=self._robot.digest,
            plan_digest=plan_digest,
            model=model,
            period=self._period,
            learned=round(self.learned, 6),
            watched=round(self.watched, 6),
            axes=self.sights(),
            alarms=tuple(self.alarms),
        )

    def _raised(self, judged: Judged) -> tuple[Alarm, ...]:
        ratio = np.abs(judged.outside) / judged.threshold
        begun = []
        for axis in np.flatnonzero((ratio >= 1.0).any(axis=0)).tolist():
            if axis not in self._open:
                self._open[axis] = len(self.alarms)
                begun.append(self._alarm(judged, axis, int(ratio[:, axis].argmax())))
                self.alarms.append(begun[-1])
                self.trace.keep(axis, judged.time)
            self._signs[axis] = judged.time
        for axis in tuple(self._open):
            self._go_on(judged, axis)
        return tuple(begun)

    def _alarm(self, judged: Judged, axis: int, window: int) -> Alarm:
        torque = float(judged.outside[window, axis])
        return Alarm(
            axis=axis + 1,
            time=round(judged.time, 6),
            torque=torque,
            threshold=float(judged.threshold[window, axis]),
            window=round(float(self._lengths[window]), 6),
            peak=torque,
        )

    def _go_on(self, judged: Judged, axis: int) -> None:
        """Follow an alarm until it is over."""
        number = self._open[axis]
        alarm = self.alarms[number]
        seen = float(judged.outside[self._soon, axis])
        self.alarms[number] = alarm.model_copy(
            update={
                "peak": max(alarm.peak, seen, key=abs),
                "lasted": round(float(self._signs[axis]) - alarm.time, 6),
            }
        )
        if judged.time - self._signs[axis] > OVER:
            del self._open[axis]

    def _count(self, judged: Judged) -> None:
        self._judged += 1
        pair = judged.threshold[[self._soon, self._late]]
        self._unseen += pair > self._sizes
        if self._judged % EVERY == 0:
            self._thresholds.append(np.where(judged.moving, pair, np.nan))
            if len(self._thresholds) > 100_000:
                del self._thresholds[::2]

    def _sight(self, axis: int) -> Sight:
        found = np.array(self._thresholds or [np.full((2, self._robot.n_joints), np.nan)])
        shown = found[np.isfinite(found[:, 0, axis]), :, axis]
        soon, late = np.median(shown, axis=0) if len(shown) else (np.nan, np.nan)
        blind, dim = (self._unseen[:, axis] / max(self._judged, 1)).tolist()
        return Sight(
            axis=axis + 1,
            unit=self._robot.torque_unit(axis),
            limit=float(self._robot.torque_limit[axis]),
            soon=float(soon),
            late=float(late),
            blind=blind,
            dim=dim,
            distance=float(self._detector.distance[axis]),
        )
