"""Reproducible draw of outages from a seed and a number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_plant.faults.fault_plan import Fault, Span, What, When

SHORTEST, LONGEST = 0.005, 0.250
"""Shortest and longest outage [s]."""
AXES = 6
DIRECTIONS = {
    "transmit": (What.TRANSMIT_OUTAGE,),
    "receive": (What.RECEIVE_OUTAGE,),
    "both": (What.TRANSMIT_OUTAGE, What.RECEIVE_OUTAGE),
    "drive": (What.BUS_OFF,),
}
"""Direction of the outage of our adapter; the last one cuts off one drive, in both directions."""


@dataclass(frozen=True)
class Outage:
    """Outage in one session.

    Attributes
    ----------
    number : int
        Number of the outage in the draw.
    frame : int
        Number of our first frame in the outage, from 1.
    length : float
        Duration of the outage [s].
    direction : str
        One of `DIRECTIONS`.
    axis : int or None
        Axis, from 1, whose drive is off the bus; None for an outage of our adapter.
    interrupted : bool
        True if Ctrl-C is pressed at the begin of the outage.
    """

    number: int
    frame: int
    length: float
    direction: str
    axis: int | None
    interrupted: bool

    @property
    def faults(self) -> tuple[Fault, ...]:
        """Return the fault plan."""
        at, lasts = When(frame=self.frame), Span(time=self.length)
        return tuple(
            Fault(what=what, axis=self.axis, at=at, lasts=lasts)
            for what in DIRECTIONS[self.direction]
        )

    def __str__(self) -> str:
        whose = self.direction if self.axis is None else f"{self.direction} {self.axis}"
        with_what = ", Ctrl-C" if self.interrupted else ""
        return (
            f"outage {self.number}: {whose}, {1000 * self.length:.0f} ms from frame {self.frame}"
            f"{with_what}"
        )


def draw(seed: int, number: int, frames: range) -> Outage:
    """Draw one outage that begins at one of these frames."""
    rng = np.random.default_rng([seed, number])
    direction, axis = str(rng.choice(list(DIRECTIONS))), int(rng.integers(1, AXES + 1))
    return Outage(
        number=number,
        frame=int(rng.choice(frames)),
        length=float(rng.uniform(SHORTEST, LONGEST)),
        direction=direction,
        axis=axis if direction == "drive" else None,
        interrupted=bool(rng.integers(2)),
    )
