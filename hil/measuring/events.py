"""What the sequencer reports while it works.

`time` is the bus's time, `remaining` the robot time that is expected to be left; both in s. In
lock-step robot time runs faster than the clock on the wall.
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
    """Something happened."""

    time: float
    remaining: float


@dataclass(frozen=True, slots=True)
class Started(Event):
    """The sequencer knows where the robot stands; nothing has moved yet."""

    pending: int
    planned: int


@dataclass(frozen=True, slots=True)
class WarmingUp(Event):
    """The warm-up goes on."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class AboutMeasurement(Event):
    """Something happened in the course of one measurement."""

    measurement: Measurement


@dataclass(frozen=True, slots=True)
class Travelled(AboutMeasurement):
    """All axes stand at the start of a measurement."""


@dataclass(frozen=True, slots=True)
class Preparing(AboutMeasurement):
    """The axes rest or exercise before a friction measurement, `done` of `duration` [s]."""

    done: float
    duration: float


@dataclass(frozen=True, slots=True)
class Rehearsed(AboutMeasurement):
    """The ways of a measurement were passed slowly, without a recording."""


@dataclass(frozen=True, slots=True)
class Paused(Event):
    """The operator wanted a pause; the axes stand still under power."""


@dataclass(frozen=True, slots=True)
class Repeated(AboutMeasurement):
    """A recording failed its checks; the measurement is tried once more."""

    attempt: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class GaveUp(AboutMeasurement):
    """No attempt passed the checks; the best recording follows as `Recorded`."""

    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Recorded(AboutMeasurement):
    """A measurement is done; `findings` is empty unless every attempt failed."""

    recording: Recording
    attempts: int
    findings: tuple[Finding, ...]


@dataclass(frozen=True, slots=True)
class Finished(Event):
    """All measurements of the plan are done.

    `before_first` is the time of motion before the first recording that was kept, warm-up and
    attempts that were repeated included [s]; NaN where nothing was recorded.
    """

    recorded: int
    gave_up: tuple[str, ...]
    before_first: float = nan
