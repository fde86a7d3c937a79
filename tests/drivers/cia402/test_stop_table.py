"""Breadth-first search through the state table of the stop, with
invariants of each pair of states.
"""

from __future__ import annotations

from collections import deque
from itertools import product

import pytest

from drivers.cia402.states import Command
from drivers.cia402.stop import AWAITED, Shown, StopPhase, next_step, overdue_phase

OFF = {Shown.OFF, Shown.OFF_AT_REST}
OBEYING = {Shown.OBEYING, Shown.AT_REST}
BRAKING = {StopPhase.STOPPING, StopPhase.SLOWING}
PAIRS = list(product(StopPhase, Shown))


def following(phase: StopPhase, shown: Shown) -> set[StopPhase]:
    """Return the possible phases after a SYNC, with and without an exceeded bound."""
    after, _ = next_step(phase, shown)
    return {after} | (
        {overdue_phase(after, shown)} if after in AWAITED | {StopPhase.RESTING} else set()
    )


def reached(phase: StopPhase, shown: set[Shown]) -> set[StopPhase]:
    """Return all phases reachable with no input except `shown`, breadth first."""
    waiting, seen = deque([phase]), {phase}
    while waiting:
        here = waiting.popleft()
        new = {after for each in shown for after in following(here, each)} - seen
        seen |= new
        waiting.extend(new)
    return seen


def test_every_phase_but_that_of_an_axis_seen_to_drift_comes_and_every_pair_has_its_row() -> None:
    assert reached(StopPhase.STOPPING, set(Shown)) == set(StopPhase) - {StopPhase.ADRIFT}
    assert len({pair: next_step(*pair) for pair in PAIRS}) == len(StopPhase) * len(Shown)


@pytest.mark.parametrize(("phase", "shown"), PAIRS)
def test_an_axis_that_shows_power_is_commanded_unless_it_obeys(
    phase: StopPhase, shown: Shown
) -> None:
    after, command = next_step(phase, shown)
    if shown in {Shown.ENABLED, Shown.ON, Shown.READY}:
        assert command is not None
    if after not in BRAKING | {StopPhase.RESTING}:
        assert command is Command.DISABLE_VOLTAGE


@pytest.mark.parametrize(("phase", "shown"), PAIRS)
def test_off_is_what_was_shown(phase: StopPhase, shown: Shown) -> None:
    if StopPhase.OFF in following(phase, shown) and phase is not StopPhase.OFF:
        assert shown in OFF | {Shown.READY}
    if shown in OFF and phase is not StopPhase.ADRIFT:
        assert next_step(phase, shown)[0] is StopPhase.OFF


@pytest.mark.parametrize(
    "phase", [each for each in StopPhase if each not in BRAKING | {StopPhase.RESTING}]
)
def test_whose_voltage_is_to_be_off_is_never_commanded_to_stop_again(phase: StopPhase) -> None:
    assert not reached(phase, set(Shown)) & (BRAKING | {StopPhase.RESTING})


@pytest.mark.parametrize("shown", [each for each in Shown if each not in OFF | {Shown.READY}])
def test_an_axis_that_never_shows_off_ends_lost_or_unseen(shown: Shown) -> None:
    phases = reached(StopPhase.STOPPING, {shown})
    assert StopPhase.OFF not in phases
    assert phases & {StopPhase.LOST, StopPhase.UNSEEN}


@pytest.mark.parametrize("phase", StopPhase)
def test_an_axis_that_shows_off_at_rest_is_off_wherever_its_stop_was(phase: StopPhase) -> None:
    assert next_step(phase, Shown.OFF_AT_REST)[0] is StopPhase.OFF


def test_an_axis_that_was_seen_to_move_without_power_is_off_only_where_it_rests() -> None:
    assert reached(StopPhase.ADRIFT, set(Shown) - {Shown.OFF_AT_REST}) == {StopPhase.ADRIFT}
