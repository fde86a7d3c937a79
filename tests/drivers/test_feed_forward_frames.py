"""Velocity and torque feed-forward on the wire, observed by a second bus."""

from __future__ import annotations

import json
import struct
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import can
import numpy as np
import pytest
import yaml
from canopen_drive_bus import CanopenDriveBus
from personalities import PLANT, drives_for, plant_file

from drivers.axis import AxisScale
from drivers.cia402.objects import TORQUE_OFFSET
from drivers.drive_bus import DriveError, DriveRefused, LimitExceeded, Move
from drivers.drives_file import load_drives
from drivers.fieldbus import Entry
from hil.model.robot import ROBOTS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from drivers.drives_file import DrivesFile

DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml")
PERIOD = DRIVES.sync_period
NODES = range(1, 7)
AXIS, NODE = 2, 3
"""Axis 3, whose motor has the opposite direction, so that signs matter."""
TORQUE, VELOCITY = 60.0, 0.25
"""Greatest feed-forward [N m, rad/s]."""
COUNT = 120
OWN = Entry(0x2010, 0, "u16", "velocity feed-forward of the position loop")
FAULT = "faults: [{what: fault, axis: 1, code: 0x2310, at: {sync: 100}}]"


def bump(height: float, axis: int = AXIS) -> Any:
    """Return a rise from zero and back, on one axis, shape (COUNT, 6)."""
    values = np.zeros((COUNT, len(NODES)))
    values[:, axis] = height * np.sin(np.pi * np.linspace(0, 1, COUNT)) ** 4
    return values


class Wire:
    """Bus of the driver, and the frames on its wire."""

    def __init__(self, bus: CanopenDriveBus, listener: can.BusABC) -> None:
        self.bus, self._listener = bus, listener

    def frames(self) -> list[tuple[int, bytes]]:
        """Return frames since the last call."""
        found = []
        while (frame := self._listener.recv(0)) is not None:
            found.append((frame.arbitration_id, bytes(frame.data)))
        return found

    def stream(self, **fed: Any) -> None:
        """Begin to stream a path at rest, with feed-forward."""
        here = self.bus.sample().q
        self.bus.stream([here] * COUNT, **fed)

    def samples(self, count: int) -> None:
        for _ in range(count):
            self.bus.sample()


@contextmanager
def wired(
    drives: DrivesFile = DRIVES,
    channel: str = "manutec-r15",
    *,
    feed_forward: bool = True,
    **plant: Any,
) -> Iterator[Wire]:
    with (
        can.Bus(interface="sim_plant", channel=channel, **plant) as listener,
        can.Bus(interface="sim_plant", channel=channel, **plant) as can_bus,
        CanopenDriveBus(can_bus, drives, feed_forward=feed_forward) as bus,
    ):
        wire = Wire(bus, listener)
        wire.frames()
        yield wire


def offsets(frames: list[tuple[int, bytes]], node: int = NODE) -> list[tuple[int, int]]:
    """Return offsets of velocity and torque that a node received by process data."""
    places = {0x400 + node, 0x300 + node}
    return [
        struct.unpack("<ih", data) for cob_id, data in frames if cob_id in places and len(data) == 6
    ]


def last_before(frames: list[tuple[int, bytes]], word: int, node: int = NODE) -> tuple[int, int]:
    """Return a node's feed-forward at its first controlword."""
    words = [
        k
        for k, (cob_id, data) in enumerate(frames)
        if cob_id == 0x200 + node and data[4:6] == struct.pack("<H", word)
    ]
    return offsets(frames[: words[0]], node)[-1]


def test_offsets_go_out_before_the_target_of_the_same_cycle() -> None:
    with wired() as wire:
        wire.stream(velocity=bump(VELOCITY).tolist(), torque=bump(TORQUE).tolist())
        wire.frames()
        wire.samples(50)
        order = [cob_id for cob_id, _ in wire.frames() if cob_id in {0x80, 0x403, 0x303}]
        assert order == [0x80, 0x403, 0x303] * 50


def test_offsets_are_in_the_drive_s_units_and_direction() -> None:
    axis = DRIVES.axes[AXIS]
    with wired() as wire:
        wire.stream(velocity=bump(VELOCITY).tolist(), torque=bump(TORQUE).tolist())
        wire.samples(COUNT)
        frames = wire.frames()
    sent = np.array(offsets(frames))
    per_mille = -TORQUE / (axis.gear_ratio * axis.rated_torque / 1000)
    assert sent[:, 1].min() == pytest.approx(per_mille, abs=1)
    assert sent[:, 0].min() == pytest.approx(VELOCITY / AxisScale.derive(axis).position, rel=1e-3)
    assert not np.any(offsets(frames, 1))


@pytest.mark.parametrize("name", ["tenth-rpm", "millidegrees", "held-acknowledge"])
def test_a_drive_of_other_units_is_led_just_as_fast(name: str, tmp_path: Path) -> None:
    """The feed-forward replaces the drive's own, so the axis follows its set-points as fast."""
    path = np.zeros((COUNT, len(NODES)))
    path[:, AXIS] = 0.02 * np.cumsum(bump(1.0)[:, AXIS]) / COUNT
    velocity = np.gradient(path, PERIOD, axis=0)
    velocity[[0, -1]] = 0.0
    with wired(drives_for(name), plant_file(tmp_path, name)) as wire:
        here = np.array(wire.bus.sample().q)
        wire.bus.stream((here + path).tolist(), velocity=velocity.tolist())
        q = np.array([wire.bus.sample().q[AXIS] for _ in range(COUNT)])
    late = np.interp(np.arange(COUNT) - 0.5, np.arange(COUNT), here[AXIS] + path[:, AXIS])
    assert np.abs(q - late).max() < 1e-3  # 6 mrad without feed-forward


def test_a_halt_takes_back_what_is_fed_forward_before_it_halts() -> None:
    with wired() as wire:
        wire.stream(torque=bump(TORQUE).tolist())
        wire.samples(COUNT // 2)
        wire.bus.halt()
        frames = wire.frames()
        assert offsets(frames)[-2][1] < -100
        assert last_before(frames, 0x010F) == (0, 0)
        assert all(offsets(frames, node)[-1] == (0, 0) for node in NODES)
        wire.samples(50)
        assert not np.any(offsets(wire.frames()))


@pytest.mark.parametrize("reason", ["leaving", "a drive's fault", "Ctrl-C"])
def test_whatever_stops_the_axes_takes_back_what_is_fed_forward(
    reason: str, tmp_path: Path
) -> None:
    faults = tmp_path / "faults.yaml"
    faults.write_text(FAULT if reason == "a drive's fault" else "faults: []")
    listened: list[tuple[int, bytes]] = []
    with suppress(DriveError, KeyboardInterrupt), wired(faults=str(faults)) as wire:
        try:
            wire.stream(torque=bump(TORQUE).tolist())
            wire.samples(COUNT // 2)
            if reason == "a drive's fault":
                wire.samples(COUNT // 2)
                pytest.fail("the fault of axis 1 did not come")
            if reason == "Ctrl-C":
                raise KeyboardInterrupt
        finally:
            wire.bus.__exit__(None, None, None)
            listened = wire.frames()
    assert last_before(listened, 0x0002) == (0, 0)
    assert all(offsets(listened, node)[-1] == (0, 0) for node in NODES)


def test_at_the_end_of_a_path_nothing_is_fed_forward_any_more() -> None:
    with wired() as wire:
        wire.stream(velocity=bump(VELOCITY).tolist(), torque=bump(TORQUE).tolist())
        wire.samples(COUNT + 5)
        assert offsets(wire.frames())[-1] == (0, 0)
        wire.bus.move({0: Move(wire.bus.sample().q[0], 0.1, 1.0)})
        wire.samples(20)


def test_what_an_earlier_master_left_is_taken_back_before_the_mode_is_entered() -> None:
    with wired(feed_forward=False) as wire:
        drive = wire.bus.servers[AXIS]
        drive.put(TORQUE_OFFSET, 250)
        wire.stream()
        assert drive.get(TORQUE_OFFSET) == 0


def test_the_drive_s_own_feed_forward_rests_as_long_as_ours_counts() -> None:
    with wired() as wire:
        drive = wire.bus.servers[AXIS]
        wire.stream(velocity=np.zeros((COUNT, 6)).tolist())
        assert drive.get(OWN) == 0
        wire.samples(COUNT + 50)
        wire.stream()
        assert drive.get(OWN) == 1000
        wire.samples(COUNT + 50)
        wire.stream(torque=np.zeros((COUNT, 6)).tolist())
        wire.samples(COUNT + 50)
        wire.bus.move({0: Move(wire.bus.sample().q[0], 0.1, 1.0)})
        assert drive.get(OWN) == 1000
        wire.samples(50)
        wire.stream(velocity=np.zeros((COUNT, 6)).tolist())
        wire.samples(10)
        wire.bus.__exit__(None, None, None)  # during the motion
        assert drive.get(OWN) == 1000


def test_rpdo_2_and_3_are_put_back_as_they_were_found() -> None:
    entries = [
        Entry(index, subindex, kind, "")
        for index, subindex, kind in [
            (0x1401, 1, "u32"), (0x1401, 2, "u8"), (0x1601, 0, "u8"), (0x1601, 1, "u32"),
            (0x1402, 1, "u32"), (0x1402, 2, "u8"), (0x1602, 0, "u8"), (0x1602, 1, "u32"),
            (0x1602, 2, "u32"),
        ]
    ]  # fmt: skip
    with wired() as wire:
        held = [wire.bus.servers[AXIS].get(entry) for entry in entries]
        wire.bus.__exit__(None, None, None)
        found = [wire.bus.servers[AXIS].get(entry) for entry in entries]
    assert held == [
        *(0x300 + NODE, 1, 1, 0x607A0020),
        *(0x400 + NODE, 1, 2, 0x60B10020, 0x60B20010),
    ]
    assert found == [
        *(0x80000300 + NODE, 255, 2, 0x60400010),
        *(0x80000400 + NODE, 255, 2, 0x607A0020, 0x60400010),
    ]


@pytest.mark.parametrize(
    ("fed", "words"),
    [
        ({"torque": bump(600.0)}, r"joint 3 .*torque 5.* N m fed forward .*\[-540, 540\] N m"),
        ({"velocity": bump(6.0)}, r"joint 3 .*velocity 5.* rad/s fed forward after 0\.\d+ s"),
        ({"torque": bump(np.nan)}, r"joint 3 .*torque nan"),
        (
            {"torque": bump(9.0) + 9.0},
            r"torque fed forward begins with 9 N m, must be zero at rest",
        ),
        ({"velocity": bump(0.1)[: COUNT // 2]}, r"velocity fed forward, of shape \(60, 6\)"),
    ],
)
def test_what_is_beyond_the_limits_is_refused_and_nothing_is_sent(
    fed: dict[str, Any], words: str
) -> None:
    with wired() as wire:
        wire.frames()
        with pytest.raises(LimitExceeded, match=words):
            wire.stream(**fed)
        assert {cob_id for cob_id, _ in wire.frames()} <= {0x80, *(0x180 + n for n in NODES)}


def test_drives_that_were_not_set_up_for_it_are_fed_nothing() -> None:
    with (
        wired(feed_forward=False) as wire,
        pytest.raises(DriveRefused, match="not set up for feed-forward"),
    ):
        wire.stream(torque=bump(TORQUE).tolist())


SPOILT = {
    "no torque offset": (
        {"missing": [0x60B2]},
        "no object 60B2:00 (torque offset), needed for feed-forward",
    ),
    "an RPDO 2 that is fixed at something else": (
        {"objects": [{"index": 0x1601, "subindex": n, "access": "ro"} for n in range(3)]},
        "(object 1 of RPDO 2) is fixed at 60400010h, 60B10020h is needed",
    ),
}
FIXED = {
    "objects": [
        {"index": 0x1401, "subindex": 1, "access": "ro", "default": 0x300, "plus_node": True},
        {"index": 0x1601, "access": "ro", "default": 2},
        {"index": 0x1601, "subindex": 1, "access": "ro", "default": 0x60B10020},
        {"index": 0x1601, "subindex": 2, "access": "ro", "default": 0x60B20010},
    ]
}


def personality(folder: Path, changes: dict[str, Any]) -> str:
    """Write a plant whose drives have this deviation; return its path."""
    path, plant = folder / "deviant.yaml", folder / "plant.yaml"
    path.write_text(json.dumps({"name": "deviant", **changes}))
    machine = yaml.safe_load(PLANT.read_text())
    for axis in machine["axes"]:
        axis["drive"]["personality"] = str(path)
    plant.write_text(json.dumps(machine))
    return str(plant)


@pytest.mark.parametrize("what", SPOILT)
def test_a_drive_that_cannot_take_it_is_refused_in_one_message_and_stays_off(
    what: str, tmp_path: Path
) -> None:
    changes, words = SPOILT[what]
    channel = personality(tmp_path, changes)
    with pytest.raises(DriveRefused) as caught, wired(DRIVES, channel):
        pytest.fail("the drives were accepted")
    assert len(str(caught.value).splitlines()) == len(NODES)
    assert [line for line in str(caught.value).splitlines() if words not in line] == []
    with wired(DRIVES, channel, feed_forward=False) as wire:
        assert wire.bus.sample().reached


def test_a_drive_whose_rpdo_2_carries_just_this_takes_set_points_by_rpdo_1(tmp_path: Path) -> None:
    with wired(DRIVES, personality(tmp_path, FIXED)) as wire:
        wire.stream(torque=bump(TORQUE).tolist())
        wire.frames()
        wire.samples(COUNT // 2)
        frames = wire.frames()
    assert offsets(frames)[-1][1] < -100
    order = [cob_id for cob_id, _ in frames if cob_id in {0x80, 0x403, 0x303, 0x203}]
    assert order == [0x80, 0x303, 0x203] * (COUNT // 2)
