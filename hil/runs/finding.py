"""What a check finds wrong with a recording."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong with a recording.

    Attributes
    ----------
    check : str
        Name of the check: gaps, telegrams, saturation, current, window, velocity, half-sums,
        stuck, partner.
    message : str
        Value, bound and remedy in a sentence.
    value, bound : float
        The figure and what it may be.
    """

    check: str
    message: str
    value: float
    bound: float

    @property
    def excess(self) -> float:
        """How far beyond its bound the value is, as a ratio of at least 1."""
        low, high = sorted((abs(self.value), abs(self.bound)))
        return (high + 1e-9) / (low + 1e-9)
