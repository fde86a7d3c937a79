"""Sessions on a bus other than CAN: requests to the drives, motions and stops."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import drive_bus_conformance as conformance
import pytest
from direct_bus import DirectBus, DirectConnection, word_of

from drivers.cia402.states import State, decode_state
from drivers.cia402.stop import NOT_ENERGISED
from drivers.drive_bus import DriveFault, DriveRefused, Move, Tripped
from drivers.drives_file import load_drives
from drivers.session.servo_axes import ServoAxes
from hil.model.robot import ROBOTS
from sim_plant.slave_network import SlaveNetwork
from sim_plant.switch_on import load_machine

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.drive_bus import DriveBus

DRIVES = load_drives(ROBOTS / "manutec-r15.drives.yaml")


@pytest.fixture
def bus() -> DirectBus:
    return DirectBus(SlaveNetwork(load_machine("manutec-r15")))


def is_off(bus: DirectBus) -> bool:
    states = {decode_state(word_of(bus, axis)) for axis in range(len(DRIVES.axes))}
    return states <= NOT_ENERGISED


class TestConformanceWithoutCan(conformance.DriveBusConformance):
    @pytest.fixture
    def open_bus(self, bus: DirectBus) -> Callable[[], DriveBus]:
        return lambda: ServoAxes(bus, DRIVES)  # type: ignore[arg-type]


def test_what_drives_held_is_put_back_and_the_bus_closed(bus: DirectBus) -> None:
    dictionary = bus.network.nodes[0].dictionary
    places = ((0x607D, 1), (0x607D, 2), (0x607F, 0), (0x6065, 0), (0x6085, 0))
    before = [dictionary.get(*place) for place in places]
    with ServoAxes(bus, DRIVES, owns_bus=True) as axes:  # type: ignore[arg-type]
        axes.move({0: Move(axes.sample().q[0] + 0.05, 0.5, 2.0)})
        assert [dictionary.get(*place) for place in places] != before
    assert [dictionary.get(*place) for place in places] == before
    assert bus.closed
    assert is_off(bus)


def test_a_drive_that_is_switched_off_by_another_hand_stops_all_axes(bus: DirectBus) -> None:
    with ServoAxes(bus, DRIVES) as axes:  # type: ignore[arg-type]
        axes.move({k: Move(q + 0.3, 1.0, 5.0) for k, q in enumerate(axes.sample().q)})
        bus.network.nodes[2].dictionary.download(0x6040, 0, b"\0\0")
        with pytest.raises(DriveFault, match="left OPERATION ENABLED"):
            [axes.sample() for _ in range(5)]
    assert is_off(bus)


def test_another_drive_than_the_file_states_is_refused_before_any_is_on(bus: DirectBus) -> None:
    bus.network.nodes[1].dictionary.set(0x1018, 2, 0x999)
    with pytest.raises(DriveRefused, match="product code 00000999h"), ServoAxes(bus, DRIVES):  # type: ignore[arg-type]
        pytest.fail("the drives were accepted")
    assert is_off(bus)


def test_a_trip_latches_and_reset_powers_on_anew(bus: DirectBus) -> None:
    with ServoAxes(bus, DRIVES) as axes:  # type: ignore[arg-type]
        bus.network.nodes[2].dictionary.download(0x6040, 0, b"\0\0")
        with pytest.raises(DriveFault):
            [axes.sample() for _ in range(5)]
        with pytest.raises(Tripped):
            axes.move({})
        axes.reset()
        axes.sample()
        assert {decode_state(word_of(bus, k)) for k in range(6)} == {State.OPERATION_ENABLED}
    assert is_off(bus)


def test_requests_before_a_move_are_no_lack_of_supervision(
    bus: DirectBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    def look_slowly(connection: DirectConnection) -> None:
        data = connection.process_data
        end, sync = data.time + 0.8, data.sync  # longer than half the watchdog's time

        def sync_late() -> float:
            data.time = max(data.time, end)
            return sync()

        monkeypatch.setattr(data, "now", lambda: max(data.time, end))
        monkeypatch.setattr(data, "sync", sync_late)

    monkeypatch.setattr(DirectConnection, "look_at_limits", look_slowly)
    with ServoAxes(bus, DRIVES) as axes:  # type: ignore[arg-type]
        axes.sample()
        axes.move({0: Move(0.5, 0.2, 2.0)})
        assert not axes.sample().reached


def test_no_frame_is_made() -> None:
    """Sessions need to import neither CAN nor CANopen."""
    import subprocess

    code = (
        "import sys, drivers.session.servo_axes, drivers.operator_tools.check;"
        "assert not {'can', 'canopen', 'drivers.canopen', 'drivers.can_bus'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)  # noqa: S603 - our own program
