"""How well SYNC kept its period while it was recorded, and what got lost: stated with every run.

In lock-step nothing can be off. On the wall clock this is what says whether computer and bus were
up to the rate. Travel between measurements does not count.
"""

from __future__ import annotations

from math import hypot, sqrt
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from drivers.drive_bus import SampleFlag

if TYPE_CHECKING:
    from hil.runs.recording import Recording

EXACT = 1e-6
"""Jitter below this is that of adding floats [s]."""

_GAPS = SampleFlag.MISSING | SampleFlag.DOUBLED | SampleFlag.LATE


class SyncTiming(FileModel):
    """SYNC in the recordings of a session.

    Attributes
    ----------
    samples, flagged, left_out : int
        SYNCs recorded; those of them with a telegram missing, doubled or late; SYNCs left out.
    jitter, worst : float
        Root mean square and maximum of how far the time between SYNCs was off the period [s].
    """

    samples: int = 0
    flagged: int = 0
    left_out: int = 0
    jitter: float = 0.0
    worst: float = 0.0

    def with_recording(self, recording: Recording) -> SyncTiming:
        """Return the timing with one more recording."""
        times = np.diff(recording.time)
        period = float(np.median(times))
        passed = np.maximum(1, np.rint(times / period))
        off = times - passed * period
        samples = self.samples + recording.n_samples
        return SyncTiming(
            samples=samples,
            flagged=self.flagged + int(np.any(recording.flags & _GAPS, axis=1).sum()),
            left_out=self.left_out + int(passed.sum()) - len(passed),
            jitter=hypot(self.jitter * sqrt(self.samples), float(np.linalg.norm(off)))
            / sqrt(samples),
            worst=max(self.worst, float(np.abs(off).max())),
        )

    def __str__(self) -> str:
        lost = f"{self.flagged} flagged, {self.left_out} left out"
        if self.worst < EXACT:
            return f"{self.samples} samples, {lost}; SYNC in lock-step"
        return (
            f"{self.samples} samples, {lost}; SYNC off its period by {self.jitter * 1e3:.2g} ms"
            f" (rms), {self.worst * 1e3:.2g} ms at most"
        )
