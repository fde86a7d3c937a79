"""Recording of a measurement as arrays, and its recorder.

A `Recorder` packs the samples of a bus into a buffer and notes where strokes begin and end; nothing
else happens between two SYNCs. At the end of the measurement the buffer becomes a `Recording` of
numpy arrays. A missing sample stays missing (NaN and a flag).
"""

from __future__ import annotations

import struct
from array import array
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from drivers.drive_bus import SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from drivers.drive_bus import Sample
    from hil.arrays import Array, Mask, Numbers
    from hil.planning.measurement import RecordedMotion

    Recorded = Iterable[tuple[RecordedMotion, "Recording"]]
    """Motions with their recordings, as processed by estimators."""

CHANCE = 1e-6
"""Probability of a false alarm in a sound recording."""
SLOWED, LEFT_OUT = 0.999, 1.5
"""Minimum progress along the trajectory per period, and minimum periods of a left-out SYNC.

With less progress the trajectory was slowed; after a longer time a SYNC was left out.
"""
IDLE = -1
"""Number of samples outside of strokes and groups."""
_UNUSED = (SampleFlag.OLD | SampleFlag.UNTIMED).value
UNITS = {
    "time": "s",
    "q": "rad",
    "tau": "N m",
    "flags": "bits: 1 missing, 2 doubled, 4 late, 8 internal limit, 32 old",
    "stroke": "number, even forward, odd back, -1 at rest",
    "partner_stroke": "number, even forward, odd back, -1 at rest",
    "qd": "rad/s",
    "group": "number of the period, block or pair of strokes, -1 at rest",
    "along": "s",
}
"""Units of the arrays of a recording."""


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Recording:
    """Samples of a measurement.

    Attributes
    ----------
    time : array (n,)
        Instants of the samples since the bus was entered [s].
    q, tau : arrays (n, n_joints)
        Joint positions [rad or m] and torques [N m or N]; NaN for a missing sample.
    flags : array (n, n_joints), uint8
        `drivers.drive_bus.SampleFlag` bits.
    stroke : array (n,), int16
        Number of the present stroke, even forward, odd back; -1 at rest, and for all samples
        without strokes.
    partner_stroke : array (n,), int16
        Number of the partner's stroke in a coupling measurement; -1 for all samples of other kinds.
    qd : array (n, n_joints), optional
        Recorded joint velocities [rad/s or m/s], NaN for a joint without; drives report none.
    group : array (n,), int16, optional
        Number of the group of samples with common friction: a period of a trajectory, a block of a
        free motion, an imported pair of strokes; -1 at rest. None if all samples are one group, as
        in measurements of strokes.
    along : array (n,), optional
        Time along the trajectory of the set-points active from each sample on, since the start of
        the first period [s]; None without streaming, and in files of earlier versions.
    """

    time: Array
    q: Array
    tau: Array
    flags: NDArray[np.uint8]
    stroke: Numbers
    partner_stroke: Numbers
    qd: Array | None = None
    group: Numbers | None = None
    along: Array | None = None

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Present arrays, by name."""
        return {name: each for name in UNITS if (each := getattr(self, name)) is not None}

    @property
    def slowed(self) -> Mask:
        """Mask of samples followed by a slowed passage of the trajectory, shape (n,)."""
        if self.along is None:
            return np.zeros(self.n_samples, dtype=bool)
        step, passed = np.diff(self.time), np.diff(self.along)
        slow = (passed < SLOWED * np.median(passed)) | (step > LEFT_OUT * np.median(step))
        return np.append(slow & (self.along[1:] < self.along[-1]), False)

    @property
    def slowed_groups(self) -> Mask:
        """Mask of samples in groups with slowed samples, shape (n,)."""
        if self.group is None:
            return self.slowed
        groups: Mask = np.isin(self.group, self.group[self.slowed]) & (self.group != IDLE)
        return groups

    @property
    def fresh(self) -> Mask:
        """Mask of complete samples, none stale or with an uncertain instant, shape (n,)."""
        good = np.isfinite(self.q) & np.isfinite(self.tau) & (self.flags & _UNUSED == 0)
        return np.ones(self.n_samples, bool) if good.all() else good.all(axis=1)

    @property
    def pair(self) -> Numbers:
        """Number of the pair of strokes, forward and back; -1 at rest."""
        return self.stroke // 2

    @property
    def active(self) -> Mask:
        """Mask of samples in a stroke or a group, shape (n,)."""
        return active_samples(self.stroke, self.group)

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

    def add_noise(self, torque: Array, position: Array, rng: np.random.Generator) -> Recording:
        """Return the recording with added white noise, standard deviations of shape (n_joints,)."""
        drawn = rng.standard_normal((2, *self.q.shape))
        return replace(self, q=self.q + position * drawn[0], tau=self.tau + torque * drawn[1])

    @property
    def units(self) -> dict[str, str]:
        """Units of the arrays by name."""
        return {name: UNITS[name] for name in self.arrays}

    def dataframe(self) -> pd.DataFrame:
        """Return the samples as a table, a column per joint (``q1``, ``tau1``, ...); needs pandas.

        ``attrs["units"]`` has the unit of each column.

        Raises
        ------
        ModuleNotFoundError
            pandas is not installed.
        """
        import pandas as pd  # noqa: PLC0415 - needed for nothing else, and not installed along

        columns, units = {}, {}
        for name, each in self.arrays.items():
            parts = [("", each)] if each.ndim == 1 else enumerate(each.T, start=1)
            for joint, values in parts:
                columns[f"{name}{joint}"], units[f"{name}{joint}"] = values, UNITS[name]
        table = pd.DataFrame(columns)
        table.attrs["units"] = units
        return table

    to_dataframe = dataframe
    """Name of `dataframe` by the convention of pandas."""

    def span(self, stroke: int) -> slice:
        """Return the samples of a stroke of the axis; empty if absent."""
        return _span(self.stroke, stroke)

    def partner_span(self, stroke: int) -> slice:
        """Return the samples of a stroke of the partner; empty if absent."""
        return _span(self.partner_stroke, stroke)


class Recorder:
    """Recorder of samples with strokes and groups.

    A buffer is used instead of a list of samples, since Python's garbage collector would scan
    hundreds of thousands of objects repeatedly.
    """

    def __init__(self) -> None:
        self._rows = bytearray()
        self._size = 1
        self._pack: Callable[..., bytes] = self._pack_first
        self._marks: defaultdict[str, list[tuple[int, int]]] = defaultdict(list)
        self._along = array("d")

    def add(self, sample: Sample, along: float | None = None) -> None:
        """Add a sample, with the position along a trajectory, if any [s]."""
        if along is not None:
            self._along.append(along)
        self.extend((sample,))

    def extend(self, samples: Sequence[Sample]) -> None:
        """Add several samples."""
        for time, q, tau, flags, _ in samples:
            self._rows += self._pack(time, *q, *tau, *flags)

    def mark(self, what: Literal["stroke", "partner_stroke", "group"], number: int) -> None:
        """Assign the following samples to a stroke of axis or partner, or a group; `IDLE`: none."""
        self._marks[what].append((len(self._rows) // self._size, number))

    def finish(self) -> Recording:
        """Convert the collected samples to arrays."""
        n_joints = (self._size - 8) // 17
        joints = [("q", "<f8", n_joints), ("tau", "<f8", n_joints), ("flags", "u1", n_joints)]
        rows = np.frombuffer(self._rows, dtype=[("time", "<f8"), *joints])
        return Recording(
            time=np.array(rows["time"], dtype=np.float64),
            q=np.array(rows["q"], dtype=np.float64, order="C"),
            tau=np.array(rows["tau"], dtype=np.float64, order="C"),
            flags=np.array(rows["flags"], order="C"),
            stroke=_numbers(self._marks["stroke"], len(rows)),
            partner_stroke=_numbers(self._marks["partner_stroke"], len(rows)),
            group=_numbers(self._marks["group"], len(rows)) if "group" in self._marks else None,
            along=np.array(self._along) if self._along else None,
        )

    def _pack_first(self, *values: float) -> bytes:
        n_joints = (len(values) - 1) // 3
        layout = struct.Struct(f"<d{2 * n_joints}d{n_joints}B")
        self._pack, self._size = layout.pack, layout.size
        return layout.pack(*values)


def active_samples(stroke: Numbers, group: Numbers | None) -> Mask:
    """Return a mask of the samples in a stroke or a group, shape (n,)."""
    of_stroke: Mask = stroke != IDLE
    return of_stroke if group is None else of_stroke | (group != IDLE)


def _numbers(marks: list[tuple[int, int]], n: int) -> Numbers:
    numbers = np.full(n, IDLE, dtype=np.int16)
    for begin, number in marks:
        numbers[begin:] = number
    return numbers


def _span(numbers: Numbers, stroke: int) -> slice:
    found = np.flatnonzero(numbers == stroke)
    return slice(int(found[0]), int(found[-1]) + 1) if len(found) else slice(0, 0)


@dataclass(frozen=True, slots=True)
class Finding:
    """Fault of a recording.

    Attributes
    ----------
    check : str
        Name of the check: gaps, telegrams, saturation, current, window, velocity, half-sums,
        stuck, partner.
    message : str
        Value, bound and remedy in a sentence.
    value, bound : float
        Value of the check, and its bound.
    """

    check: str
    message: str
    value: float
    bound: float

    @property
    def excess(self) -> float:
        """Ratio of the value to the bound, at least 1."""
        low, high = sorted((abs(self.value), abs(self.bound)))
        return (high + 1e-9) / (low + 1e-9)
