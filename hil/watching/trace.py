"""Torque traces around alarms, or at the end without an alarm."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.watching.detector import Judged


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
    n_joints : int
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
