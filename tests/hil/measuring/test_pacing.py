"""Bus slowed down to a multiple of the wall clock."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from hil.measuring import pacing
from hil.measuring.pacing import PacedBus

if TYPE_CHECKING:
    import pytest
    from conftest import IdealBus


def took(bus: PacedBus, samples: int) -> float:
    begun = time.monotonic()
    for _ in range(samples):
        bus.sample()
    return time.monotonic() - begun


def test_samples_come_as_fast_as_in_real_time_then_faster(
    ideal_bus: IdealBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pacing, "REAL_TIME", 0.3)
    monkeypatch.setattr(pacing, "DOUBLED", 0.01)
    paced = PacedBus(ideal_bus, 5.0)
    real = 50 * ideal_bus.period
    assert real <= took(paced, 51) + 1e-3
    took(paced, round(0.2 / ideal_bus.period))
    assert took(paced, 50) >= real / 5 - 1e-3


def test_what_came_late_is_not_made_up_for(ideal_bus: IdealBus) -> None:
    paced = PacedBus(ideal_bus, 1.0)
    took(paced, 5)
    time.sleep(0.3)
    assert took(paced, 26) >= 25 * ideal_bus.period - 1e-3
