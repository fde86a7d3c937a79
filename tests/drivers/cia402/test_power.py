"""Power on for all drives together and power off for one, without a bus."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from fake_fieldbus import PERIOD, FakeDrive, FakeFieldbus

from drivers.cia402 import objects
from drivers.cia402.power import STEP_TIME, Power
from drivers.cia402.states import State
from drivers.cia402.supervision import Supervision
from drivers.drive_bus import DriveFault, DriveRefused, NodeSilent

if TYPE_CHECKING:
    from drivers.fieldbus import Entry

WORDS = {State.FAULT: 0x08, State.FAULT_REACTION_ACTIVE: 0x0F}


class OtherDrive(FakeDrive):
    """Drive that reacts slowly, has a fault, or does not answer at first.

    Attributes
    ----------
    reacting : float
        Remaining duration of the fault reaction [s].
    faults : int
        Number of resets without effect on the fault; 0 without a fault.
    closed : float
        Remaining time in which commands by process data have no effect [s].
    unanswered : int
        Number of commands by SDO still to be lost.
    stays : bool
        True if the drive does not leave SWITCHED ON.
    """

    reacting = closed = 0.0
    faults = unanswered = 0
    stays = False

    @property
    def word(self) -> int:
        if self.reacting > 0:
            return WORDS[State.FAULT_REACTION_ACTIVE]
        return WORDS[State.FAULT] if self.faults else super().word

    def put(self, entry: Entry, value: int) -> None:
        if self.unanswered:
            self.unanswered -= 1
            raise NodeSilent(f"{self.label}: no answer")
        if entry == objects.CONTROLWORD and value == 0x80 and self.faults:
            self.faults -= 1
        super().put(entry, value)

    def control(self, word: int, target: int) -> None:
        if self.closed <= 0 and not self.stays:
            super().control(word, target)

    def step(self) -> None:
        super().step()
        self.reacting, self.closed = self.reacting - PERIOD, self.closed - PERIOD


class Bench:
    """Two drives, the second possibly unusual, and their power."""

    def __init__(self) -> None:
        self.bus = FakeFieldbus(2)
        self.first, self.second = self.bus.drives = (OtherDrive(1), OtherDrive(2))
        self.power = Power(self.bus, self.bus.drives, Supervision(self.bus.drives))

    def walk(self, goal: State) -> None:
        self.power.walk(goal, self.bus.sync)

    def states(self) -> list[State]:
        return [drive.state for drive in self.bus.drives]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_the_end_of_a_fault_reaction_is_awaited_before_the_fault_is_reset(bench: Bench) -> None:
    bench.second.reacting, bench.second.faults = 2.9, 1
    bench.power.make_safe(bench.second, reset_fault=True)
    assert (bench.second.faults, bench.second.state) == (0, State.SWITCH_ON_DISABLED)


def test_a_fault_reaction_without_end_is_refused(bench: Bench) -> None:
    bench.second.reacting = 3.2
    with pytest.raises(DriveFault, match="axis 2: fault reaction does not end"):
        bench.power.make_safe(bench.second, reset_fault=True)


def test_a_fault_that_outlasts_its_reset_is_refused(bench: Bench) -> None:
    bench.second.faults = 2
    with pytest.raises(DriveFault, match="axis 2: the fault returns after a reset"):
        bench.power.make_safe(bench.second, reset_fault=True)


def test_a_fault_that_nobody_asked_to_reset_is_not_reset(bench: Bench) -> None:
    bench.second.faults = 1
    with pytest.raises(DriveFault, match="then reset the fault"):
        bench.power.make_safe(bench.second, reset_fault=False)
    assert bench.second.faults == 1


@pytest.mark.parametrize(
    "state",
    [
        State.OPERATION_ENABLED,
        State.QUICK_STOP_ACTIVE,
        State.SWITCHED_ON,
        State.READY_TO_SWITCH_ON,
    ],
)
def test_a_drive_that_was_left_in_any_state_is_switched_off(bench: Bench, state: State) -> None:
    bench.second.state = state
    bench.power.make_safe(bench.second, reset_fault=False)
    assert bench.second.state is State.SWITCH_ON_DISABLED


def test_a_command_to_switch_off_that_is_lost_is_given_once_more(bench: Bench) -> None:
    bench.second.state, bench.second.unanswered = State.OPERATION_ENABLED, 1
    bench.power.switch_off(bench.second)
    assert bench.second.state is State.SWITCH_ON_DISABLED
    bench.second.unanswered = 2
    with pytest.raises(NodeSilent):
        bench.power.switch_off(bench.second)


def test_a_drive_that_stays_switched_on_has_not_been_switched_off(bench: Bench) -> None:
    bench.second.state, bench.second.stays = State.SWITCHED_ON, True
    with pytest.raises(DriveRefused, match="it shows SWITCHED ON; press the emergency stop"):
        bench.power.switch_off(bench.second)


@pytest.mark.parametrize("goal", [State.SWITCHED_ON, State.OPERATION_ENABLED])
def test_power_is_on_once_the_last_drive_has_it(bench: Bench, goal: State) -> None:
    bench.second.closed = 0.9 * STEP_TIME
    bench.walk(goal)
    assert bench.states() == [goal, goal]
    assert bench.bus.time > bench.second.closed


def test_a_drive_that_takes_more_than_three_seconds_is_refused(bench: Bench) -> None:
    bench.second.closed = 2.9
    bench.walk(State.SWITCHED_ON)
    bench.second.closed = 3.1
    with pytest.raises(DriveRefused, match="axis 2: stays in SWITCHED ON, OPERATION ENABLED was"):
        bench.walk(State.OPERATION_ENABLED)


@pytest.mark.parametrize(("reacting", "faults"), [(0.5, 1), (0.0, 1)])
def test_a_drive_that_faults_ends_power_on_for_all_at_once(
    bench: Bench, reacting: float, faults: int
) -> None:
    bench.second.reacting, bench.second.faults = reacting, faults
    with pytest.raises(DriveFault, match="axis 2"):
        bench.walk(State.SWITCHED_ON)
    assert bench.bus.time == PERIOD


def test_a_drive_is_energised_where_it_stands(bench: Bench) -> None:
    for drive, position in zip(bench.bus.drives, (70_000, -300), strict=True):
        drive.position = drive.target = position
        drive.put(objects.MODE, 8)
    bench.walk(State.SWITCHED_ON)
    bench.walk(State.OPERATION_ENABLED)
    assert [drive.target for drive in bench.bus.drives] == [70_000, -300]


def test_a_drive_that_is_not_seen_is_not_commanded(bench: Bench) -> None:
    bench.walk(State.SWITCHED_ON)
    bench.bus.commanded.clear()
    bench.bus.silent = {1}
    with pytest.raises(DriveRefused, match="axis 2"):
        bench.walk(State.OPERATION_ENABLED)
    assert {axis for axis, _ in bench.bus.commanded} == {0}
