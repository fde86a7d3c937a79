"""Trips of the driver, and the limits and the heartbeat watchdog set in the drives."""

from __future__ import annotations

import math
import re
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import local_drives
import numpy as np
import pytest
from canopen_drive_bus import CanopenDriveBus
from fake_fieldbus import axes_of
from local_bench import NODES, all_off, axis, drives_file, refused

from drivers.drive_bus import DriveRefused, Move, Tripped
from drivers.drives_file import DrivesFile
from drivers.safety.trips import Trips

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import Sample

PER_RADIAN = 4096 * 100 / (2 * math.pi)


def open_bus(can_bus: Any, **changes: Any) -> CanopenDriveBus:
    return CanopenDriveBus(can_bus, drives_file(**changes))


def sample_until(drive_bus: CanopenDriveBus, holds: Callable[[Sample], bool]) -> Sample:
    for _ in range(2000):
        sample = drive_bus.sample()
        if holds(sample):
            return sample
    raise AssertionError("it never came")


def show(drive: Any, current: int) -> None:
    """Let a drive report a current in per mille of the rated current."""
    drive.node.set_data(0x6078, 0, current.to_bytes(2, "little", signed=True))


# Corridor


@pytest.mark.parametrize("way", [0.1, -0.1])
@pytest.mark.parametrize("at", [25, 26])
def test_an_axis_that_leaves_its_place_stops_all_within_two_syncs(
    can_bus: Any, way: float, at: int
) -> None:
    with open_bus(can_bus, trip={"velocity": 1000.0}) as drive_bus:
        for _ in range(at):
            drive_bus.sample()
        can_bus.drives[1].position += way * PER_RADIAN
        can_bus.sent.clear()
        words = r"joint 1 .* outside -0.05 \.\.\. 0.05 rad around the set-point"
        with pytest.raises(Tripped, match=words):
            sample_until(drive_bus, lambda _: False)
        sent = [frame.arbitration_id for frame in can_bus.sent]
        assert sent[: sent.index(0x201)].count(0x80) <= 2
        stopped = {f.arbitration_id for f in can_bus.sent if f.data[4:] == b"\x02\x00"}
        assert stopped == {0x201, 0x202, 0x203}
    assert all_off(can_bus)


def test_an_axis_may_be_anywhere_on_its_way(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        drive_bus.move({0: Move(0.5, 1.0, 10.0)})
        sample_until(drive_bus, lambda sample: sample.reached)
        drive_bus.move({0: Move(-0.5, 1.0, 10.0)})
        sample_until(drive_bus, lambda sample: sample.q[0] < 0)
        drive_bus.move({0: Move(0.3, 1.0, 10.0)})
        assert sample_until(drive_bus, lambda sample: sample.reached).q[0] == pytest.approx(
            0.3, abs=1e-4
        )


def test_an_axis_that_runs_the_wrong_way_is_stopped(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        drive_bus.move({0: Move(0.5, 1.0, 10.0)})
        sample_until(drive_bus, lambda sample: sample.q[0] > 0.01)
        can_bus.drives[1].target = -0.5 * PER_RADIAN
        with pytest.raises(Tripped, match=r"joint 1 .* outside -0.05 \.\.\. 0.55 rad"):
            sample_until(drive_bus, lambda _: False)


def test_an_axis_may_not_go_back_where_its_last_move_came_from(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        for target in (0.5, 0.4):
            drive_bus.move({0: Move(target, 1.0, 10.0)})
            sample_until(drive_bus, lambda sample: sample.reached)
        can_bus.drives[1].target = 0.2 * PER_RADIAN
        with pytest.raises(Tripped, match=r"outside 0.35 \.\.\. 0.55 rad"):
            sample_until(drive_bus, lambda _: False)


# Speed


def test_an_encoder_that_jumps_within_the_corridor_is_noticed(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        drive_bus.move({1: Move(1.0, 1.0, 10.0)})
        sample_until(drive_bus, lambda sample: sample.q[1] > 0.2)
        can_bus.drives[2].position -= 0.3 * PER_RADIAN
        with pytest.raises(
            Tripped, match=r"joint 2 .*rad/s, at most 2.6 rad/s allowed \(trip.vel"
        ) as caught:
            sample_until(drive_bus, lambda _: False)
    assert all_off(can_bus)
    stated = re.search(r"(\S+) rad in (\S+) s is (\S+) rad/s", str(caught.value))
    assert stated is not None
    way, elapsed, speed = map(float, stated.groups())
    assert way == pytest.approx(0.3, abs=0.03)
    assert speed == pytest.approx(way / elapsed, rel=0.01)


def test_full_speed_is_no_overspeed(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        drive_bus.move({0: Move(1.5, 2.0, 20.0)})
        assert sample_until(drive_bus, lambda sample: sample.reached).q[0] == pytest.approx(
            1.5, abs=1e-4
        )


def test_way_made_while_tpdos_were_lost_is_not_taken_for_speed(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        drive_bus.move({0: Move(1.5, 2.0, 20.0)})
        sample_until(drive_bus, lambda sample: sample.q[0] > 0.1)
        can_bus.outgoing = lambda frame: [] if frame.arbitration_id == 0x181 else [frame]
        for _ in range(7):
            drive_bus.sample()
        can_bus.outgoing = lambda frame: [frame]
        assert sample_until(drive_bus, lambda sample: sample.reached).q[0] == pytest.approx(
            1.5, abs=1e-4
        )


# Torque: 1 per mille of 2 A are 0.1 N m


def test_torque_near_the_limit_for_long_stops_all_axes(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        show(can_bus.drives[2], -2900)
        with pytest.raises(
            Tripped, match=r"joint 2 .*: 290 N m for 0.5\d* s, at most .* s above 285 N m"
        ):
            sample_until(drive_bus, lambda _: False)
    assert all_off(can_bus)


def test_torque_may_peak_for_a_short_time(can_bus: Any) -> None:
    with open_bus(can_bus) as drive_bus:
        for current, samples in 4 * ((2900, 100), (100, 25)):
            show(can_bus.drives[2], current)
            for _ in range(samples):
                drive_bus.sample()


def test_a_stated_torque_trip_counts(can_bus: Any) -> None:
    with open_bus(can_bus, trip={"torque": 20.0, "torque_time": 0.1}) as drive_bus:
        show(can_bus.drives[1], 250)
        with pytest.raises(Tripped, match=r"25 N m for 0.1\d* s, at most .* s above 20 N m"):
            sample_until(drive_bus, lambda _: False)


# The same trips without a bus, SYNC by SYNC

PERIOD = 0.004


def armed(**changes: Any) -> Trips:
    """Return trips of the first drive, at 0 in a wide corridor with a limit of 2.6 rad/s."""
    trips = Trips(axes_of(drives_file(**changes).axes[:1]), PERIOD)
    trips.arm(0.0, (0,))
    trips.follow([-(10**9)], [10**9])
    return trips


def shown(trips: Trips, syncs: int, speed: float, late: float = 0.0) -> list[str]:
    """Return trips of an axis that moves at `speed` [rad/s]; half the samples are `late` [s]."""
    found = []
    for number in range(1, syncs + 1):
        true = PERIOD * number + (late if number & 2 else 0.0)
        position = (round(speed * true * PER_RADIAN),)
        data: Any = SimpleNamespace(positions=position, currents=(0,), irregular=False)
        tripped = trips.look(PERIOD * number, data)
        found += [str(tripped)] if tripped else []
    return found


def test_a_fifth_more_than_the_speed_that_may_be_stops_the_axes() -> None:
    assert shown(armed(), 20, 2.5) == []
    assert "rad/s, at most 2.6 rad/s" in shown(armed(), 20, 1.3 * 2.6)[0]


def test_a_sync_that_comes_late_by_less_than_half_a_period_is_no_overspeed() -> None:
    assert shown(armed(), 40, 2.5, late=0.45 * PERIOD) == []


def test_torque_before_the_axes_were_armed_anew_does_not_count() -> None:
    trips = armed()
    high: Any = SimpleNamespace(positions=(0,), currents=(2900,), irregular=False)

    def trips_until(begin: float, end: float) -> bool:
        return any(trips.look(time, high) for time in np.arange(begin, end, PERIOD))

    assert not trips_until(0.0, 0.4)  # of a permitted 0.5 s
    trips.arm(10.0, (0,))
    assert not trips_until(10.0, 10.4)
    assert trips_until(10.4, 10.6)


# Limits supervised by the drives themselves


def values(drive: Any, *indices: int) -> list[int]:
    return [drive.value(index) for index in indices]


def test_all_limits_are_in_the_drive_too() -> None:
    indices = (0x6080, 0x60C5, 0x60C6, 0x6085)
    objects = {(index, 0): ("u32", 0) for index in indices}
    bus = local_drives.LocalBus(NODES, {1: objects})
    with bus, open_bus(bus):
        first = bus.drives[1]
        velocity, acceleration = int(2 * PER_RADIAN), int(20 * PER_RADIAN)
        assert values(first, 0x607F, 0x6080, 0x6072) == [velocity, 1910, 3000]
        assert values(first, 0x60C5, 0x60C6, 0x6085) == [acceleration] * 3


@pytest.mark.parametrize(("present", "noted"), [((), True), ((0x607F,), False), ((0x6080,), False)])
def test_one_limit_of_speed_in_the_drive_is_enough(present: tuple[int, ...], noted: bool) -> None:
    objects = {(i, 0): ("u32", 0) if i in present else None for i in (0x607F, 0x6080)}
    bus = local_drives.LocalBus(NODES, {2: objects})
    with bus, open_bus(bus) as drive_bus:
        words = (
            "joint 2 (node 2): no object 607F:00 (max profile velocity) nor 6080:00 (max motor"
            " speed): only the driver enforces this limit, not the drive"
        )
        assert (words in drive_bus.notes) is noted


def test_where_torque_cannot_be_limited_the_current_is() -> None:
    bus = local_drives.LocalBus(NODES, {2: {(0x6072, 0): None, (0x6073, 0): ("u16", 9999)}})
    with bus, open_bus(bus):
        assert bus.drives[2].value(0x6073) == 3000


# Heartbeat watchdog


REASON = "the cell's light curtain cuts the power"


def state_reason() -> DrivesFile:
    axes = [axis(node, allow_no_heartbeat=REASON) for node in range(1, NODES + 1)]
    return DrivesFile.model_validate({"bitrate": 1_000_000, "axes": axes})


def test_a_drive_that_cannot_watch_our_heartbeat_is_refused() -> None:
    message = refused({2: {(0x1016, 1): None}}, DriveRefused)
    assert "1016:01 (consumer heartbeat time)" in message
    assert "state allow_no_heartbeat with the reason in the drives file" in message


def test_a_watch_that_does_not_read_back_is_refused_even_with_a_reason() -> None:
    bus = local_drives.LocalBus(NODES, {})
    bus.drives[2].insists[0x1016, 1] = 0
    with bus, pytest.raises(DriveRefused, match=r"1016.* reads back 0 after"):
        CanopenDriveBus(bus, state_reason()).__enter__()


def test_with_a_reason_the_drive_serves_and_the_reason_is_shown() -> None:
    bus = local_drives.LocalBus(NODES, {2: {(0x1016, 1): None}})
    with bus, CanopenDriveBus(bus, state_reason()) as drive_bus:
        assert any(note.endswith(f"allowed because: {REASON}") for note in drive_bus.notes)
        assert bus.drives[1].value(0x1016, 1) == 127 << 16 | 500


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        (20_000, "or its encoder jumps: check"),
        (1 << 15, "its encoder jumps, or wraps around at 32768 counts (607B): check"),
        (-(1 << 15) + 100, "or wraps around at 32768 counts (607B): check"),
        (1 << 20, "or another master changed the mapping"),
    ],
)
@pytest.mark.parametrize("syncs_before", [0, 1])
def test_what_else_than_motion_may_show_a_jump_is_named(
    counts: int, words: str, syncs_before: int
) -> None:
    trips = Trips(axes_of(drives_file().axes[:1]), PERIOD)
    trips.arm(0.0, (0,))
    found = []
    for number in range(1, syncs_before + 3):
        position = (0 if number <= syncs_before else counts,)
        data: Any = SimpleNamespace(positions=position, currents=(0,), irregular=False)
        found.append(trips.look(PERIOD * number, data))
    (first, *_) = (str(error) for error in found if error is not None)
    assert words in first
