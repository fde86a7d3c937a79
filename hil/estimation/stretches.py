"""Some minutes of many recordings: the middles of all, or of every so many."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.planning.free_motion import FreeMotion
    from hil.runs.recording import Recording

STRETCHES = 150.0
"""Time of all stretches together, at most [s]."""
LEAST = 5.0
"""Of one recording, where it is as long [s]."""


class Stretches:
    """Middle parts of recordings, which become shorter and then fewer as more recordings come.

    Parameters
    ----------
    most : float
        Time of all together, at most [s].

    Attributes
    ----------
    kept : list of (FreeMotion, Recording)
    """

    def __init__(self, most: float = STRETCHES) -> None:
        self.kept: list[tuple[FreeMotion, Recording]] = []
        self._most = self._length = most
        self._every, self._seen = 1, 0

    def add(self, motion: FreeMotion, recording: Recording) -> None:
        """Take the middle of a recording, if it is its turn."""
        self._seen += 1
        if (self._seen - 1) % self._every:
            return
        self.kept.append((motion, _middle(recording, self._length)))
        while sum(lasting(each) for _, each in self.kept) > self._most:
            self._shorten()

    def _shorten(self) -> None:
        if self._length > LEAST:
            self._length = max(self._length / 2, LEAST)
            self.kept = [(motion, _middle(each, self._length)) for motion, each in self.kept]
        else:
            self._every *= 2
            self.kept = self.kept[::2]


def lasting(recording: Recording) -> float:
    """Duration of a recording [s]."""
    return recording.period * recording.n_samples


def _middle(recording: Recording, length: float) -> Recording:
    n = round(length / recording.period)
    first = max(0, (recording.n_samples - n) // 2)
    part = slice(first, first + n)
    arrays = {each.name: getattr(recording, each.name) for each in fields(recording)}
    return replace(recording, **{k: x[part] for k, x in arrays.items() if x is not None})
