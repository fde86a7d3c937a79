"""Samples judged together are all judged, and alarms of the last ones are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from hil.results.watch import Alarm
from hil.watching.watcher import WatchingBus

if TYPE_CHECKING:
    from conftest import IdealBus

    from drivers.drive_bus import Sample

PUSH = Alarm(axis=2, time=0.04, torque=9, threshold=5, window=0.02, peak=9, lasted=0.2)


class CountingWatcher:
    """Watcher that counts samples and raises an alarm at the tenth."""

    def __init__(self) -> None:
        self.counts: list[int] = []

    def take(self, *samples: Sample) -> tuple[Alarm, ...]:
        self.counts.append(len(samples))
        return (PUSH,) if sum(self.counts) == 10 else ()


@pytest.mark.parametrize(
    ("at_once", "counts"), [(1, [1] * 10), (4, [4, 4, 2]), (5, [5, 5]), (50, [10])]
)
def test_the_last_samples_are_judged_when_the_bus_is_left(
    ideal_bus: IdealBus, at_once: int, counts: list[int]
) -> None:
    watcher: Any = CountingWatcher()
    shown: list[Alarm | None] = []
    with WatchingBus(ideal_bus, watcher, shown.append, at_once=at_once) as bus:
        for _ in range(10):
            bus.sample()
    assert watcher.counts == counts
    assert shown[-1] == PUSH
    assert ideal_bus.log[-1] == "powered off"
