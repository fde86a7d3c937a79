"""Outages during fast moves: no axis has power without a watchdog, distances are bounded.

`benchmarks/ethercat_outages.py` draws any number of outages.
"""

from __future__ import annotations

import pytest
from ethercat_outages.session import KINDS, Outage, happen

HALFWAY = 500
"""Cycle in the fastest move."""


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("length", [pytest.param(0.02, marks=pytest.mark.long), 0.2])
def test_every_promise_is_kept(kind: str, length: float) -> None:
    verdict = happen(Outage(1, HALFWAY, length, kind, 3, 0.2, interrupted=False))
    assert not verdict.broken, verdict
    ends = kind == "error" or (length > 0.04 and kind != "lost")
    assert bool(verdict.ended) == ends


@pytest.mark.parametrize(
    "axis", [1, 4, *(pytest.param(axis, marks=pytest.mark.long) for axis in (2, 3, 5, 6))]
)
def test_a_cable_that_is_cut_for_good_stops_what_is_before_it(axis: int) -> None:
    verdict = happen(Outage(2, HALFWAY, 60.0, "cut", axis, 0.0, interrupted=False))
    assert not verdict.unwatched
    assert not verdict.energised
    assert verdict.ended == "NodeSilent"
    assert verdict.share < 1.0
