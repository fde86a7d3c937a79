"""What the drives reported, as a `Sample`: counts become SI, gaps become NaN.

A regular sample is two products and a difference per axis; the flags of limits change with the
statuswords only, so whoever notices that notes them.
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
    """Turns the values of process data into samples.

    Parameters
    ----------
    axes : sequence of Axis
        In joint order.

    Attributes
    ----------
    limits : tuple of int, length n_axes
        `SampleFlag.LIMIT` of each axis that is at its internal limit.
    """

    def __init__(self, axes: Sequence[Axis]) -> None:
        scales = [axis.scale for axis in axes]
        self._zeros = [scale.zero for scale in scales]
        self._shifted = any(self._zeros)
        self._per_increment = [scale.position for scale in scales]
        self._per_current = [scale.torque for scale in scales]
        self.limits = (0,) * len(axes)

    def note_limits(self, words: Sequence[int]) -> None:
        """Take which axes are at their internal limit from new statuswords."""
        self.limits = tuple(SampleFlag.LIMIT.value if word & _LIMIT else 0 for word in words)

    def sample(self, time: float, process_data: ProcessData, reached: bool) -> Sample:
        """Return the sample of the last SYNC.

        Parameters
        ----------
        time : float
            The SYNC's instant [s].
        process_data : ProcessData
            What it brought.
        reached : bool
            See `Sample`.
        """
        sample = self._regular(
            time, process_data.positions, process_data.currents, self.limits, reached
        )
        if process_data.irregular:
            sample = _with_gaps(sample, process_data.flags)
        if process_data.untimed:
            flags = tuple(flag | SampleFlag.UNTIMED.value for flag in sample.flags)
            sample = sample._replace(flags=flags)
        return sample

    def several(self, cycles: Cycles, limits: tuple[int, ...], reached: bool) -> list[Sample]:
        """Return the samples of several regular SYNCs, axes at their internal limit in `limits`."""
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


def _with_gaps(sample: Sample, gaps: Sequence[int]) -> Sample:
    gone = [bool(gap & SampleFlag.MISSING) for gap in gaps]
    return sample._replace(
        q=tuple(math.nan if g else q for g, q in zip(gone, sample.q, strict=True)),
        tau=tuple(math.nan if g else tau for g, tau in zip(gone, sample.tau, strict=True)),
        flags=tuple(gap | flag for gap, flag in zip(gaps, sample.flags, strict=True)),
    )
