"""A stretch of the time line: a measurement, or the way to it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Segment:
    """One stretch of time.

    Attributes
    ----------
    kind : str
        Of measurement, or ``travel`` or ``warm-up``.
    words : str
        What happens, for readers.
    begin, end : float
        [s].
    axes : tuple of int
        Whose torque is read, from 0.
    recorded : bool
        Whether it is a measurement.
    problem : str, optional
        Why the dry run refuses it.
    """

    kind: str
    words: str
    begin: float
    end: float
    axes: tuple[int, ...] = ()
    recorded: bool = False
    problem: str | None = None
