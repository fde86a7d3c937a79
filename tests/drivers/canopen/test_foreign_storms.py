"""Storms of valid commands by other masters: no axis has power after the run."""

from __future__ import annotations

import struct
from contextlib import suppress
from typing import TYPE_CHECKING

import can
import pytest
from canopen_drive_bus import CanopenDriveBus
from hypothesis import example, given, settings
from hypothesis import strategies as st

from drivers.drive_bus import DriveError, Move
from drivers.drives_file import load_drives
from hil.model.robot import ROBOTS
from sim_plant.physics.state import ENABLED
from sim_plant.slave_network import SlaveNetwork
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Sequence

pytestmark = pytest.mark.long
NODES = 2
SYNC = 0x80
LONGEST = 400
"""Number of SYNCs of a storm: power-on, motions, stop and shutdown."""
ALONE = 3.0
"""Time without any master after a storm, for the drives' own reactions [s]."""

Frame = tuple[int, bytes]
nodes = st.integers(1, NODES)
words = st.sampled_from([0x00, 0x02, 0x06, 0x07, 0x0B, 0x0F, 0x1F, 0x80, 0x10F])
OBJECTS = {
    0x1005: (4, [0x80]), 0x1006: (4, [0, 4000]), 0x1016: (4, [0, 0x7F01F4]),
    0x1017: (2, [0, 100]), 0x1400: (4, [0x80000201]), 0x1800: (4, [0x80000181]),
    0x6007: (2, [0, 1, 2, 3]), 0x6040: (2, [0x00, 0x06, 0x07, 0x0F, 0x80]),
    0x605A: (2, [0, 2, 6]), 0x6060: (1, [1, 3, 6, 8]), 0x6065: (4, [0, 100_000]),
    0x6072: (2, [0, 100, 3000]), 0x607A: (4, [0, 40_000]), 0x6081: (4, [0, 100_000]),
    0x6085: (4, [1, 100_000]),
}  # fmt: skip
"""Objects that a tool may write, with sizes and values."""
_RECORDS = frozenset({0x1016, 0x1400, 0x1800})


@st.composite
def nmt(draw: st.DrawFn) -> Frame:
    return 0, bytes([draw(st.sampled_from([1, 2, 128, 129, 130])), draw(st.integers(0, NODES))])


@st.composite
def rpdo(draw: st.DrawFn) -> Frame:
    identifier = draw(st.sampled_from([0x200, 0x300])) + draw(nodes)
    target = struct.pack("<i", draw(st.integers(-50_000, 50_000)))
    return identifier, target + (struct.pack("<H", draw(words)) if identifier < 0x300 else b"")


@st.composite
def download(draw: st.DrawFn) -> Frame:
    index = draw(st.sampled_from(sorted(OBJECTS)))
    size, values = OBJECTS[index]
    command = 0x23 | (4 - size) << 2
    data = struct.pack("<BHBI", command, index, index in _RECORDS, draw(st.sampled_from(values)))
    return 0x600 + draw(nodes), data


frames = st.one_of(nmt(), rpdo(), download(), st.just((SYNC, b"")))
storms = st.lists(st.tuples(st.integers(1, LONGEST), frames), min_size=1, max_size=12)


class StormyBus(can.BusABC):
    """Plant in lock-step, and another master that sends after certain SYNCs of ours."""

    lock_step = True

    def __init__(self, storm: Sequence[tuple[int, Frame]]) -> None:
        self.machine = load_machine("manutec-r15")
        self.network = SlaveNetwork(self.machine)
        self._inbox = [*map(_message, self.network.power_on())]
        self._storm, self._syncs = sorted(storm, key=lambda each: each[0]), 0
        super().__init__("storm")
        self.channel_info = "storm"

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        del timeout
        self._pass(msg.arbitration_id, bytes(msg.data))
        self._syncs += msg.arbitration_id == SYNC
        while self._storm and self._storm[0][0] <= self._syncs:
            _, (identifier, data) = self._storm.pop(0)
            self._inbox.append(_message((self.network.time, identifier, data)))
            self._pass(identifier, data)

    def _pass(self, identifier: int, data: bytes) -> None:
        self._inbox += map(_message, self.network.receive(identifier, data))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        del timeout
        return (self._inbox.pop(0) if self._inbox else None), True


def _message(frame: tuple[float, int, bytes]) -> can.Message:
    time, identifier, data = frame
    return can.Message(timestamp=time, arbitration_id=identifier, data=data, is_extended_id=False)


def run(bus: StormyBus) -> int:
    """Move axes back and forth on a bus; return the number of samples."""
    file = load_drives(ROBOTS / "manutec-r15.drives.yaml")
    drives = file.model_copy(update={"axes": file.axes[:NODES], "sdo_timeout": 0.02})
    samples = 0
    with suppress(DriveError), CanopenDriveBus(bus, drives) as axes:
        while samples < LONGEST:
            sample = axes.sample()
            samples += 1
            if sample.reached:
                there = 0.1 if sample.q[0] < 0.05 else 0.0
                axes.move({n: Move(there, 0.5, 2.0) for n in range(NODES)})
    return samples


@settings(max_examples=30)
@given(storms)
@example([(40, (0, b"\x02\x00"))])
@example([(40, (0x601, struct.pack("<BHBI", 0x2B, 0x6007, 0, 0))), (40, (0, b"\x02\x01"))])
@example([(n, (0x201, struct.pack("<iH", 0, 0x0F))) for n in range(60, 90)])
def test_no_axis_is_energised_after_a_storm_of_valid_foreign_commands(
    storm: list[tuple[int, Frame]],
) -> None:
    with StormyBus(storm) as bus:
        run(bus)
        bus.network.elapse(ALONE)
        assert not bus.machine.state[:, ENABLED].any()


def test_without_a_storm_the_axes_move_to_the_end() -> None:
    with StormyBus([]) as bus:
        assert run(bus) == LONGEST
