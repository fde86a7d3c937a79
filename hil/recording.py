"""One measurement as arrays, and how it comes to be.

A `Recorder` collects the samples of a bus as they are, tuples in a list, and notes where strokes
begin and end; that is all that happens between two SYNCs. Only when the measurement is over does
it become a `Recording` of numpy arrays. A sample that is missing stays missing (NaN and a flag).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from drivers.drive_bus import Sample

IDLE = -1
"""Stroke number of samples where the axis is not under way."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """All samples of one measurement.

    Attributes
    ----------
    time : array (n,)
        Instants of the samples since the bus was entered [s].
    q, tau : arrays (n, n_joints)
        Joint positions [rad] and torques [N m]; NaN where a sample is missing.
    flags : array (n, n_joints), uint8
        `drivers.drive_bus.SampleFlag` bits.
    stroke : array (n,), int16
        Number of the stroke under way, even forward, odd back; -1 at rest.
    partner_stroke : array (n,), int16
        The same of a coupling measurement's partner; -1 throughout for the other kinds.
    """

    time: NDArray[np.float64]
    q: NDArray[np.float64]
    tau: NDArray[np.float64]
    flags: NDArray[np.uint8]
    stroke: NDArray[np.int16]
    partner_stroke: NDArray[np.int16]

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.time)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return int(self.q.shape[1])

    @property
    def period(self) -> float:
        """Mean time between samples [s]."""
        return float(self.time[-1] - self.time[0]) / max(1, self.n_samples - 1)

    def span(self, stroke: int) -> slice:
        """Return the samples of one stroke of the axis; empty where it does not occur."""
        return _span(self.stroke, stroke)

    def partner_span(self, stroke: int) -> slice:
        """Return the samples of one stroke of the partner; empty where it does not occur."""
        return _span(self.partner_stroke, stroke)


class Recorder:
    """Collects samples and the strokes that they belong to."""

    def __init__(self) -> None:
        self._samples: list[Sample] = []
        self._strokes: list[tuple[int, int]] = []
        self._partner_strokes: list[tuple[int, int]] = []
        self.add = self._samples.append
        """Takes one `Sample`."""

    def stroke(self, number: int) -> None:
        """Count samples from here on to this stroke of the axis (`IDLE`: to none)."""
        self._strokes.append((len(self._samples), number))

    def partner_stroke(self, number: int) -> None:
        """Count samples from here on to this stroke of the partner (`IDLE`: to none)."""
        self._partner_strokes.append((len(self._samples), number))

    def finish(self) -> Recording:
        """Turn what was collected into arrays."""
        n = len(self._samples)
        time, q, tau, flags, _ = zip(*self._samples, strict=True)
        return Recording(
            time=np.array(time, dtype=np.float64),
            q=_table(q),
            tau=_table(tau),
            flags=_table(flags).astype(np.uint8),
            stroke=_numbers(self._strokes, n),
            partner_stroke=_numbers(self._partner_strokes, n),
        )


def _table(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    """Rows of equal length as an array; much faster than `numpy.array` on tuples."""
    width = len(rows[0])
    flat = np.fromiter(chain.from_iterable(rows), np.float64, len(rows) * width)
    return flat.reshape(len(rows), width)


def _numbers(marks: list[tuple[int, int]], n: int) -> NDArray[np.int16]:
    numbers = np.full(n, IDLE, dtype=np.int16)
    for begin, number in marks:
        numbers[begin:] = number
    return numbers


def _span(numbers: NDArray[np.int16], stroke: int) -> slice:
    found = np.flatnonzero(numbers == stroke)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 0)
