"""Conversion of process data to a `Sample`: counts become SI, gaps become NaN.

A regular sample takes two products and a difference per axis. Limit flags change only with the
statuswords; the caller then updates the flags by `SampleReader.note_limits`.
"""

from __future__ import annotations

import math
from operator import mul, sub
from typing import TYPE_CHECKING

from drivers.cia402.states import Status
from drivers.drive_bus import Sample, SampleFlag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import Cycles, ProcessData

_LIMIT = Status.INTERNAL_LIMIT.value
_new_tuple = tuple.__new__  # half the time of Sample(...), at every SYNC


class SampleReader:
    """Converter of process data to samples.

    Parameters
    ----------
    axes : sequence of Axis
        Axes in joint order.

    Attributes
    ----------
    limits : tuple of int, length n_axes
        `SampleFlag.LIMIT` of each axis at its internal limit.
    """

    def __init__(self, axes: Sequence[Axis]) -> None:
        scales = [axis.scale for axis in axes]
        self._zeros = [scale.zero for scale in scales]
        self._shifted = any(self._zeros)
        self._per_increment = [scale.position for scale in scales]
        self._per_current = [scale.torque for scale in scales]
        self.limits = (0,) * len(axes)

    def note_limits(self, words: Sequence[int]) -> None:
        """Update the limit flags from new statuswords."""
        self.limits = tuple(SampleFlag.LIMIT.value if word & _LIMIT else 0 for word in words)

    def sample(self, time: float, process_data: ProcessData, reached: bool) -> Sample:
        """Return the sample of the last SYNC.

        Parameters
        ----------
        time : float
            Instant of the SYNC [s].
        process_data : ProcessData
        reached : bool
            See `Sample`.
        """
        sample = self._regular(
            time, process_data.positions, process_data.currents, self.limits, reached
        )
        if process_data.irregular:
            gaps = process_data.flags
            gone = [bool(gap & SampleFlag.MISSING) for gap in gaps]
            sample = sample._replace(
                q=tuple(math.nan if g else q for g, q in zip(gone, sample.q, strict=True)),
                tau=tuple(math.nan if g else tau for g, tau in zip(gone, sample.tau, strict=True)),
                flags=tuple(gap | flag for gap, flag in zip(gaps, sample.flags, strict=True)),
            )
        if process_data.untimed:
            flags = tuple(flag | SampleFlag.UNTIMED.value for flag in sample.flags)
            sample = sample._replace(flags=flags)
        return sample

    def convert_several(
        self, cycles: Cycles, limits: tuple[int, ...], reached: bool
    ) -> list[Sample]:
        """Return the samples of several regular SYNCs with the same limit flags."""
        regular = self._regular
        return [regular(*values, limits, reached) for values in zip(*cycles, strict=True)]

    def _regular(
        self,
        time: float,
        positions: Sequence[float],
        currents: Sequence[float],
        limits: tuple[int, ...],
        reached: bool,
    ) -> Sample:
        increments = map(sub, positions, self._zeros) if self._shifted else positions
        q = tuple(map(mul, self._per_increment, increments))
        tau = tuple(map(mul, self._per_current, currents))
        return _new_tuple(Sample, (time, q, tau, limits, reached))
