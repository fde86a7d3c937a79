"""Jogging and homing: one axis, slowly, with the operator's consent, and off afterwards."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
from probing_bench import Scripted, bench, drives_of

from drivers.axis import AxisScale
from drivers.canopen.bus import CanopenBus
from drivers.cia402 import objects
from drivers.drive_bus import DriveRefused, LimitExceeded, Move, MoveFailed
from drivers.drives_file import Homing
from drivers.operator_tools.home import home, jog
from drivers.operator_tools.operator import StoppedByOperator
from drivers.operator_tools.small_move import _Watch

if TYPE_CHECKING:
    import can
    from probing_bench import AlteredBus

    from drivers.drives_file import AxisDrive

SLOW = math.radians(5)
HERE = {"method": 37, "position": 0.5, "velocity": 0.2, "creep": 0.02, "acceleration": 1.0}


def position(bus: AlteredBus, axis: AxisDrive) -> float:
    """Return the position of an axis, read by SDO [rad]."""
    unpowered = CanopenBus(bus).unpowered(drives_of(axis.node))
    unpowered.wait(0.02)
    return AxisScale.derive(axis).position_from_counts(
        float(unpowered.servers[0].get(objects.POSITION))
    )


@pytest.mark.parametrize("way", [math.radians(4), math.radians(-4)])
def test_a_jog_ends_where_it_was_sent_with_the_axis_off(way: float) -> None:
    drives = drives_of(1, 3)
    with bench() as bus:
        operator = Scripted()
        stroke = jog(CanopenBus(bus), drives, drives.axes[1], way, SLOW, operator)
        assert bus.left_off
        assert position(bus, drives.axes[1]) == pytest.approx(way, abs=0.002)
    assert stroke.q[-1] - stroke.q[0] == pytest.approx(way, abs=0.002)
    assert stroke.peak_torque > 10
    assert f"from 0° to {math.degrees(way):.4g}° at 5°/s?" in operator.shown[0]


def test_only_the_axis_that_jogs_is_powered() -> None:
    drives = drives_of(1, 2)
    with bench() as bus:
        commanded: set[int] = set()
        send = bus.send
        bus.send = lambda msg, timeout=None: (
            commanded.add(msg.arbitration_id),
            send(msg, timeout),
        )
        jog(CanopenBus(bus), drives, drives.axes[1], 0.02, SLOW, Scripted())
    assert {number & 0x7F for number in commanded if number & 0x780 in {0x200, 0x600}} == {2}


@pytest.mark.parametrize(
    ("way", "velocity", "words"),
    [
        (9.0, SLOW, "target 9 rad must be in"),
        (0.1, 2.0, "must be at most 34.38°/s, 20% of its limit"),
    ],
)
def test_a_jog_too_far_or_too_fast_is_refused_without_power(
    way: float, velocity: float, words: str
) -> None:
    drives = drives_of(1)
    with bench() as bus:
        with pytest.raises(LimitExceeded, match=words):
            jog(CanopenBus(bus), drives, drives.axes[0], way, velocity, Scripted())
        assert not bus.powered


def test_without_consent_nothing_jogs_and_nothing_homes() -> None:
    drives = drives_of(1, homing=HERE)
    with bench() as bus:
        no = Scripted(agreed=False)
        with pytest.raises(StoppedByOperator, match="did not agree"):
            jog(CanopenBus(bus), drives, drives.axes[0], 0.1, SLOW, no)
        with pytest.raises(StoppedByOperator, match="did not agree"):
            home(CanopenBus(bus), drives, drives.axes[0], Homing(**HERE), no, patience=10)
        assert not bus.powered


def test_a_key_stops_a_jog_on_its_way_and_switches_off() -> None:
    drives = drives_of(1)
    with bench() as bus:
        with pytest.raises(StoppedByOperator):
            jog(CanopenBus(bus), drives, drives.axes[0], 0.5, SLOW, Scripted(q=100))
        assert bus.left_off
        assert 0.005 < position(bus, drives.axes[0]) < 0.1


# Homing


def homed(bus: AlteredBus | can.BusABC, axis: int, **changes: object) -> float:
    drives = drives_of(axis)
    how = Homing.model_validate(HERE | changes)
    return home(CanopenBus(bus), drives, drives.axes[0], how, Scripted(), patience=60)


@pytest.mark.parametrize("axis", [1, 3])
@pytest.mark.parametrize("method", [35, 37])
def test_the_present_position_becomes_the_stated_one(axis: int, method: int) -> None:
    with bench() as bus:
        assert homed(bus, axis, method=method) == pytest.approx(0.5, abs=0.002)
        assert bus.left_off
        assert position(bus, drives_of(axis).axes[0]) == pytest.approx(0.5, abs=0.002)


@pytest.mark.parametrize(("method", "end"), [(17, -1), (18, 1)])
def test_a_limit_switch_becomes_the_stated_position_time_and_again(method: int, end: int) -> None:
    drives = drives_of(2)
    with bench() as bus:
        for said in (end * 1.92, end * 1.5):
            assert homed(bus, 2, method=method, position=said, velocity=0.3) == pytest.approx(
                said, abs=0.01
            )
            jog(CanopenBus(bus), drives, drives.axes[0], -end * 0.1, SLOW, Scripted())


def test_an_axis_moves_as_before_after_homing() -> None:
    drives = drives_of(3)
    with bench() as bus:
        homed(bus, 3)
        stroke = jog(CanopenBus(bus), drives, drives.axes[0], 0.1, SLOW, Scripted())
        assert stroke.q[-1] == pytest.approx(0.6, abs=0.004)


def test_a_drive_without_homing_mode_is_refused_with_what_to_do_instead() -> None:
    def drop(frame: can.Message) -> None:
        if frame.arbitration_id & 0x780 == 0x580 and frame.data[1:3] == b"\x02\x65":
            frame.data[4] = 1

    with bench(alter=drop) as bus:
        with pytest.raises(DriveRefused, match=r"no homing mode .* state the position there"):
            homed(bus, 1)
        assert not bus.powered


def test_a_method_that_the_drive_does_not_know_is_refused_and_the_axis_off() -> None:
    with bench() as bus:
        with pytest.raises(DriveRefused, match="6098:00"):
            homed(bus, 1, method=-4)
        assert bus.left_off


def test_homing_that_finds_nothing_ends_in_time_with_the_axis_off() -> None:
    drives = drives_of(1)
    with bench() as bus:
        how = Homing.model_validate(HERE | {"method": 17})
        with pytest.raises(MoveFailed, match="no reference found by method 17 in 1 s"):
            home(CanopenBus(bus), drives, drives.axes[0], how, Scripted(), patience=1)
        assert bus.left_off


def test_a_key_stops_homing() -> None:
    drives = drives_of(1)
    with bench() as bus:
        how = Homing.model_validate(HERE | {"method": 17})
        with pytest.raises(StoppedByOperator):
            home(CanopenBus(bus), drives, drives.axes[0], how, Scripted(q=300), patience=60)
        assert bus.left_off


def test_homing_faster_than_a_jog_may_be_is_refused() -> None:
    with bench() as bus:
        with pytest.raises(LimitExceeded, match=r"homing.velocity .* at most"):
            homed(bus, 1, velocity=2.0)
        assert not bus.powered


def test_an_axis_is_as_fast_as_it_went_between_samples_however_far_apart_they_are() -> None:
    move = Move(1.0, SLOW, 1.0)
    watch = _Watch("joint 1", drives_of(1).axes[0], 0.0, move, 0.004)
    for step in (1, 2, 12, 13, 40, 41, 42, 43):  # cycles missed by this computer
        watch.look(0.004 * step, 0.004 * step * SLOW)
    with pytest.raises(MoveFailed, match=r"rad/s, 0\.0873 rad/s was commanded"):
        watch.look(0.004 * 44, 0.004 * 144 * SLOW)
