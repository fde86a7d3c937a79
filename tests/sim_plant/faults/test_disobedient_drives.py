"""Drives that ignore their controlword: effect of commands and of the watchdog.

The tests examine both statusword and machine, which may contradict each other.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from faulty_bench import SYNC, network, write

from sim_plant.physics import state as st

if TYPE_CHECKING:
    from sim_plant.faults.faulty_network import FaultyNetwork

QUICK_STOP, DISABLE_VOLTAGE, SHUTDOWN = 0x02, 0x00, 0x06
STATES = {0x27: "enabled", 0x07: "quick stop active", 0x40: "off", 0x08: "fault"}
HEARTBEAT = (0x77F, b"\5")


def move_axis_1(*lines: str) -> FaultyNetwork:
    """Return drives with axis 1 in a long move at 1 rad/s, with a watchdog of 0.1 s."""
    faulty = network(*lines)
    per_rad = 105 * 4096 / math.tau
    for index, sub, size, value in (
        (0x6060, 0, 1, 1),
        (0x605A, 0, 2, 2),
        (0x6007, 0, 2, 3),
        (0x607A, 0, 4, round(2 * per_rad)),
        (0x6081, 0, 4, round(per_rad)),
        (0x6083, 0, 4, round(10 * per_rad)),
        (0x6084, 0, 4, round(10 * per_rad)),
        (0x6085, 0, 4, round(10 * per_rad)),
        (0x1016, 1, 4, 127 << 16 | 100),
        *((0x6040, 0, 2, word) for word in (0x06, 0x07, 0x0F, 0x1F)),
    ):
        write(faulty, 1, index, sub, size, value)
    cycles(faulty, 75)
    assert shown(faulty) == ("enabled", True)
    assert speed(faulty) == pytest.approx(1.0, abs=0.05)
    return faulty


def cycles(faulty: FaultyNetwork, count: int, *, alive: bool = True) -> None:
    for _ in range(count):
        if alive:
            faulty.receive(*HEARTBEAT)
        faulty.receive(*SYNC)


def command(faulty: FaultyNetwork, word: int) -> None:
    write(faulty, 1, 0x6040, 0, 2, word)
    cycles(faulty, 50)


def shown(faulty: FaultyNetwork) -> tuple[str, bool]:
    """Return the state in axis 1's statusword, and True if the machine has it energised."""
    word = faulty.nodes[0].dictionary.get(0x6041)
    state = STATES[word & (0x4F if word & 0x48 else 0x6F)]
    return state, bool(faulty.machine.plant.state[0, st.ENABLED])


def speed(faulty: FaultyNetwork) -> float:
    return float(faulty.machine.plant.state[0, st.QD])


def planned(what: str, lasts: str = "") -> str:
    return f"{{what: {what}, axis: 1, at: {{time: 0}}{lasts}}}"


def test_a_drive_that_obeys_stops_and_switches_off() -> None:
    faulty = move_axis_1()
    command(faulty, QUICK_STOP)
    assert shown(faulty) == ("off", False)


def test_a_quick_stop_that_is_ignored_changes_nothing_but_voltage_can_be_disabled() -> None:
    faulty = move_axis_1(planned("quick-stop-ignored"))
    command(faulty, QUICK_STOP)
    assert shown(faulty) == ("enabled", True)
    assert speed(faulty) == pytest.approx(1.0, abs=0.05)
    command(faulty, DISABLE_VOLTAGE)
    assert shown(faulty) == ("off", False)


def test_a_drive_that_ignores_disable_voltage_stops_and_stays_energised() -> None:
    faulty = move_axis_1(planned("disable-voltage-ignored"))
    for word in (DISABLE_VOLTAGE, SHUTDOWN, 0x07):
        command(faulty, word)
        assert shown(faulty) == ("enabled", True)
    command(faulty, QUICK_STOP)
    assert speed(faulty) == pytest.approx(0.0, abs=0.01)
    command(faulty, DISABLE_VOLTAGE)
    assert shown(faulty) == ("quick stop active", True)


def test_a_stop_without_effect_shows_but_leaves_the_axis_on_its_way_to_the_target() -> None:
    faulty = move_axis_1(planned("stop-without-effect"))
    command(faulty, QUICK_STOP)
    assert shown(faulty) == ("quick stop active", True)
    assert speed(faulty) == pytest.approx(1.0, abs=0.05)
    command(faulty, DISABLE_VOLTAGE)
    assert shown(faulty) == ("off", False)


def test_a_stop_without_effect_ends_at_the_target() -> None:
    faulty = move_axis_1(planned("stop-without-effect"))
    command(faulty, QUICK_STOP)
    cycles(faulty, 500)
    assert shown(faulty) == ("off", False)
    assert faulty.machine.plant.state[0, st.Q] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("word", [QUICK_STOP, None])
@pytest.mark.parametrize(
    "what", ["quick-stop-ignored", "disable-voltage-ignored", "stop-without-effect"]
)
def test_the_watchdog_of_a_drive_that_disobeys_works(what: str, word: int | None) -> None:
    faulty = move_axis_1(planned(what))
    if word is not None:
        command(faulty, word)
    cycles(faulty, 100, alive=False)
    assert shown(faulty) == ("fault", False)


def test_a_watchdog_without_reaction_leaves_a_drive_that_disobeys_as_it_is() -> None:
    faulty = move_axis_1(planned("quick-stop-ignored"))
    write(faulty, 1, 0x6007, 0, 2, 0)
    cycles(faulty, 50, alive=False)
    assert shown(faulty) == ("enabled", True)


def test_a_drive_obeys_again_once_its_fault_is_over() -> None:
    faulty = move_axis_1(planned("quick-stop-ignored", ", lasts: {time: 0.4}"))
    command(faulty, QUICK_STOP)
    assert shown(faulty) == ("enabled", True)
    command(faulty, 0x0F)
    command(faulty, QUICK_STOP)
    assert shown(faulty) == ("off", False)


def test_a_node_watches_once_it_has_heard_the_heartbeat_that_its_dictionary_names() -> None:
    faulty = network()
    seen = []
    for change in (
        lambda: write(faulty, 1, 0x1016, 1, 4, 127 << 16 | 100),
        lambda: cycles(faulty, 1),
        lambda: cycles(faulty, 50, alive=False),
        lambda: write(faulty, 1, 0x1016, 1, 4, 0),
    ):
        change()
        seen.append(faulty.nodes[0].is_watching)
    assert seen == [False, True, True, False]
