"""Motions and recordings of all kinds of measurement.

Strokes follow one another as soon as the bus reports that the axis rests at its target. Time passes
only in `bus.sample()`, and every time-out is in the bus's time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from drivers.drive_bus import Move
from hil.measuring.checks.encoder_jumps import finished
from hil.measuring.streaming import stream
from hil.measuring.travel import locate, pass_along, stand, until_reached
from hil.planning.strokes import PARTNER_TURN, REST, SETTLED
from hil.runs.recording import IDLE, Recorder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from drivers.drive_bus import DriveBus, Sample
    from hil.planning.measurement import Coupling, Friction
    from hil.planning.strokes import Partner, Strokes
    from hil.runs.recording import Recording


def record(bus: DriveBus, measurement: Strokes) -> Recording:
    """Carry out the strokes of a measurement and record every sample.

    The axes start at ``measurement.start`` and return there with the last stroke.

    Raises
    ------
    MoveFailed
        A stroke was not finished in time.
    Tripped
        An encoder jumped.
    """
    return _record(bus, Recorder(), measurement, None)


def record_creep(bus: DriveBus, measurement: Coupling) -> Recording:
    """Record strokes like `record`, with a partner going back and forth in every stroke."""
    recorder = Recorder()
    partner = _PartnerStrokes(bus, recorder, measurement.q, measurement.partner)
    return _record(bus, recorder, measurement, partner)


def _record(
    bus: DriveBus, recorder: Recorder, measurement: Strokes, partner: _PartnerStrokes | None
) -> Recording:
    last = _rest(bus, recorder)
    for number in range(measurement.n_strokes):
        profile = measurement.profile(number)
        recorder.mark("stroke", number)
        bus.move({measurement.index: Move(profile.end, profile.velocity, profile.acceleration)})
        take: Callable[[Sequence[Sample]], float | None] = recorder.extend
        if partner:
            partner.begin(last.time + profile.window[0], last.time + profile.window[1])
            take = partner.take
        what = f"{measurement.id}, stroke {number + 1}"
        last = until_reached(bus, take, last.time, profile.duration, what)
    recorder.mark("stroke", IDLE)
    recorder.mark("partner_stroke", IDLE)
    _rest(bus, recorder)
    return finished(bus, recorder, measurement.highest_acceleration)


def rest_and_exercise(bus: DriveBus, measurement: Friction) -> Iterator[tuple[float, float]]:
    """Prepare friction by the planned history: rest, then motion up to the recording.

    Yields
    ------
    tuple of float
        Duration so far, and the bus's time [s].
    """
    begin, rest = locate(bus).time, measurement.rest or 0.0
    while (now := locate(bus).time) - begin < rest:
        # reports at least every 5 s
        now = stand(bus, min(5.0, rest - (now - begin))).time
        yield now - begin, now
    while (now := locate(bus).time) - begin < measurement.preparation:
        for number in (0, 1):
            profile = measurement.profile(number)
            now = pass_along(bus, measurement.index, profile, f"{measurement.id}, exercise").time
        yield now - begin, now


MANNERS: dict[str, Callable[[DriveBus, Any], Recording]] = {
    "gravity": record,
    "inertia": record,
    "coupling": record_creep,
    "friction": record,
    "trajectory": stream,
}
"""Functions that carry out a kind of measurement and return the recording."""
PREPARATIONS: dict[str, Callable[[DriveBus, Any], Iterator[tuple[float, float]]]] = {
    "friction": rest_and_exercise,
}
"""Preparations before the first attempt; yield their duration so far, and the bus's time [s]."""


class _PartnerStrokes:
    """Strokes of the partner while the other axis creeps.

    The bus reports only the arrival of all axes, so the partner's turns follow the duration of its
    profile. No stroke starts that would end after the creeping axis brakes.
    """

    def __init__(
        self, bus: DriveBus, recorder: Recorder, q: Sequence[float], partner: Partner
    ) -> None:
        self._bus = bus
        self._recorder = recorder
        self._q = q
        self._partner = partner
        self._number = 0
        self._due = self._last = 0.0

    def begin(self, earliest: float, latest: float) -> None:
        """Allow strokes between two instants [s]."""
        self._recorder.mark("partner_stroke", IDLE)
        self._due = earliest + SETTLED
        self._last = latest - self._partner.profile(self._q, 0).duration - PARTNER_TURN

    def take(self, samples: Sequence[Sample]) -> float:
        """Process samples and start a due stroke; return the instant of the next stroke [s]."""
        self._recorder.extend(samples)
        now = samples[-1].time
        if now >= self._due:
            if now > self._last:
                self._recorder.mark("partner_stroke", IDLE)
                self._due = math.inf
            else:
                self._start(now)
        return self._due

    def _start(self, now: float) -> None:
        profile = self._partner.profile(self._q, self._number)
        move = Move(profile.end, profile.velocity, profile.acceleration)
        self._recorder.mark("partner_stroke", self._number)
        self._bus.move({self._partner.index: move})
        self._number += 1
        self._due = now + profile.duration + PARTNER_TURN


def _rest(bus: DriveBus, recorder: Recorder) -> Sample:
    """Record samples at rest, as padding for the filters; return the last sample."""
    left = max(1, round(REST / bus.period))
    while left > 0:
        samples = bus.samples(left)
        recorder.extend(samples)
        left -= len(samples)
    return samples[-1]
