"""Outages of our adapter during motion: no drive keeps power, least of all unsupervised.

The true state is read from the machine and from the drives' own dictionaries
(`fault_table.witness`).
"""

from __future__ import annotations

import functools
import logging
import time
from typing import TYPE_CHECKING

import can
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from fault_table.logged_bus import LoggedBus
from fault_table.stopping_way import allowed_ways, reaction_time
from fault_table.trial import drives
from fault_table.witness import Witness
from hypothesis import given
from hypothesis import strategies as some
from outage_sweep.draws import DIRECTIONS, LONGEST, SHORTEST, draw
from outage_sweep.session import frames_sent, happen

from drivers.drive_bus import Move
from sim_plant.faults.fault_plan import Fault, FaultPlan, Span, What, When
from sim_plant.faults.faulty_network import FaultyNetwork
from sim_plant.physics import state as st
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from collections.abc import Iterator

AXES = range(6)
LENGTHS = (0.055, 0.075, 0.095, 0.120)


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    logging.disable()  # the driver's log of a session that ended
    yield
    logging.disable(logging.NOTSET)


# Undisturbed session


def test_no_axis_is_energised_before_its_drive_has_heard_our_heartbeat() -> None:
    with LoggedBus(()) as bus:
        with CanopenDriveBus(bus, drives) as drive_bus:
            drive_bus.sample()
            assert bus.plant.state[:, st.ENABLED].all()
        assert not bus.plant.state[:, st.ENABLED].any()
    assert bus.witness.unwatched == set()


# Ctrl-C with six axes moving, and an outage at that moment


class UnreliableBus(LoggedBus):
    """Plant in lock-step behind an adapter that may fail by the wall clock."""

    fails_until = 0.0

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if time.monotonic() < self.fails_until:
            raise can.CanOperationError("transmit buffer is full")
        super().send(msg, timeout)

    def fail(self, duration: float, clock: str) -> None:
        """Accept no frame for this duration, from now on."""
        if clock == "wall":
            self.fails_until = time.monotonic() + duration
            self.witness.begin()
        else:
            at, lasts = When(time=0), Span(time=duration)
            self.network.add(Fault(what=What.TRANSMIT_OUTAGE, at=at, lasts=lasts))

    def leave_alone(self) -> None:
        """Wait until the adapter works again before the time without a master."""
        time.sleep(max(0.0, self.fails_until - time.monotonic()))
        super().leave_alone()


@functools.cache
def interrupted(clock: str, length: float) -> UnreliableBus:
    """Return a session with Ctrl-C and an outage of our adapter at full speed, then 3 s alone.

    The simulation is shared by all tests.
    """
    with UnreliableBus((), reaction=reaction_time(length, drives)) as bus:
        with pytest.raises(KeyboardInterrupt):
            press_at_speed(bus, clock, length)
        bus.leave_alone()
    return bus


def press_at_speed(bus: UnreliableBus, clock: str, length: float) -> None:
    with CanopenDriveBus(bus, drives) as drive_bus:
        drive_bus.move({axis: Move(1.8, 1.2, 7.0) for axis in AXES})
        while np.abs(bus.plant.state[:, st.QD]).min() < 1.0:
            drive_bus.sample()
        bus.fail(length, clock)
        raise KeyboardInterrupt


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("clock", ["plant", "wall"])
def test_an_outage_at_ctrl_c_leaves_no_axis_energised_with_its_watchdog_off(
    clock: str, length: float
) -> None:
    assert interrupted(clock, length).witness.unwatched == set()


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("clock", ["plant", "wall"])
def test_an_outage_at_ctrl_c_leaves_no_axis_energised(clock: str, length: float) -> None:
    bus = interrupted(clock, length)
    assert not bus.plant.state[:, st.ENABLED].any()
    assert bus.witness.off_after is not None
    assert bus.witness.off_after < 2.0


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("clock", ["plant", "wall"])
def test_after_an_outage_at_ctrl_c_no_axis_goes_farther_than_stated(
    clock: str, length: float
) -> None:
    witness = interrupted(clock, length).witness
    shares = witness.ways / allowed_ways(witness.speeds, length, drives)
    assert shares.max() <= 1.0


# Random outages: those of benchmarks/outages.py


@functools.cache
def frames() -> range:
    return frames_sent()


@pytest.mark.parametrize("number", range(40))
def test_a_random_outage_breaks_no_promise(number: int) -> None:
    outage = draw(1, number, frames())
    verdict = happen(outage)
    assert verdict.unwatched == (), str(outage)
    assert verdict.energised == (), str(outage)
    assert verdict.share <= 1.0, str(outage)


@given(seed=some.integers(0, 1000), number=some.integers(0, 10**6), n=some.integers(1, 10**4))
def test_outages_are_drawn_within_their_bounds_and_again_by_seed_and_number(
    seed: int, number: int, n: int
) -> None:
    moments = range(700, 700 + n)
    outage = draw(seed, number, moments)
    assert outage.frame in moments
    assert SHORTEST <= outage.length <= LONGEST
    assert outage.direction in DIRECTIONS
    assert (outage.axis in range(1, 7)) == (outage.direction == "drive")
    assert draw(seed, number, moments) == outage


# The witness


def watched(*nodes: int) -> FaultyNetwork:
    """Return a plant with all axes energised, and some drives supervising our heartbeat."""
    network = FaultyNetwork(load_plant("manutec-r15"), "sync", FaultPlan(faults=()))
    network.power_on()
    for node in network.nodes:
        if node.node_id in nodes:
            node.dictionary.write(0x1016, 1, 127 << 16 | 500)
    network.receive(0x77F, b"\5")
    for axis in network.machine.axes:
        axis.enable()
    return network


def test_the_witness_finds_axes_that_are_energised_and_unwatched() -> None:
    witness = Witness(watched(1, 2, 4, 6))
    witness.look()
    assert witness.unwatched == {3, 5}
    assert witness.energised


def test_the_witness_does_not_mind_who_is_unwatched_but_off() -> None:
    network = watched(1, 2, 4, 6)
    for axis in (2, 4):
        network.machine.axes[axis].disable()
    witness = Witness(network)
    witness.look()
    assert witness.unwatched == set()


def test_the_witness_measures_the_way_from_the_event_and_the_speed_until_somebody_can_react() -> (
    None
):
    network = watched()
    witness = Witness(network, reaction=0.1)
    per_rad = 105 * 4096 / (2 * np.pi)
    network.machine.axes[0].move(0.5 * per_rad, per_rad, 5 * per_rad, 5 * per_rad)
    for step in range(200):
        if step == 25:
            witness.begin()
            before = network.machine.plant.state[0, st.Q]
        network.elapse(0.004)
        witness.look()
    assert witness.ways[0] == pytest.approx(0.5 - before, abs=1e-3)
    assert witness.speeds[0] == pytest.approx(1.0, abs=0.03)
    assert witness.ways[1:].max() < 1e-3
    witness.begin()
    assert witness.ways.max() == 0.0
