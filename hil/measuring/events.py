"""Events reported by the sequencer.

`time` is the bus's time, `remaining` the expected remaining robot time, both in s. In lock-step
robot time runs faster than wall time.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.planning.measurement import Measurement
    from hil.runs.recording import Finding, Recording


@dataclass(frozen=True, slots=True)
class Event:
    """Event of a campaign."""

    time: float
    remaining: float


@dataclass(frozen=True, slots=True)
class Started(Event):
    """Start of the campaign: the robot's position is known, nothing has moved yet."""

    pending: int
    planned: int


@dataclass(frozen=True, slots=True)
class WarmingUp(Event):
    """Progress of the warm-up."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class AboutMeasurement(Event):
    """Event of a single measurement."""

    measurement: Measurement


@dataclass(frozen=True, slots=True)
class Travelled(AboutMeasurement):
    """Arrival of the axes at the start of a measurement."""


@dataclass(frozen=True, slots=True)
class Preparing(AboutMeasurement):
    """Rest or exercise of the axes before a friction measurement, `done` of `duration` [s]."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class Rehearsed(AboutMeasurement):
    """Rehearsal of a measurement's motions, without a recording."""


@dataclass(frozen=True, slots=True)
class Paused(Event):
    """Pause requested by the operator; the axes stand still under power."""


@dataclass(frozen=True, slots=True)
class Repeated(AboutMeasurement):
    """Repetition of a measurement after a recording failed its checks."""

    attempt: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class GaveUp(AboutMeasurement):
    """Failure of all attempts; the best recording follows as `Recorded`."""

    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Recorded(AboutMeasurement):
    """Completion of a measurement; `findings` is empty unless every attempt failed."""

    recording: Recording
    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Finished(Event):
    """Completion of the plan's measurements.

    `before_first` is the time of motion before the first recording kept, including warm-up and
    repeated attempts [s]; NaN without recordings.
    """

    recorded: int
    gave_up: tuple[str, ...]
    before_first: float = nan
