"""Changes by another master or tool during a session stop the axes and are stated as the reason."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from drivers.drive_bus import DriveError, Move, Tripped
from drivers.ethercat import registers as reg

if TYPE_CHECKING:
    from collections.abc import Callable

    from plant_wire import PlantWire

    from drivers.session.servo_axes import ServoAxes

    Opening = Callable[..., ServoAxes]

ENABLED = 0x27
GUARDS = {
    "divider": (reg.WATCHDOG_DIVIDER, 2, 0xFFFF),
    "off": (reg.WATCHDOG_TIME, 2, 0),
    "longer": (reg.WATCHDOG_TIME, 2, 50_000),
    "not fed": (reg.MANAGER + 2 * reg.MANAGER_SIZE + 4, 1, 0x24),
}


def energised(wire: PlantWire) -> list[int]:
    words = [node.dictionary.get(0x6041) & 0x6F for node in wire.segment.nodes]
    return [axis for axis, word in enumerate(words) if word == ENABLED]


def ends(open_bus: Opening, event: Callable[[], None], moves: int) -> DriveError:
    """Return the error that ends a session of some small moves after an event."""
    with pytest.raises(DriveError) as caught, open_bus() as bus:  # noqa: PT012 - a session
        here = bus.sample().q[0]
        event()
        for number in range(moves):
            bus.move({0: Move(here + 0.01 * (number % 2), 0.5, 2.0)})
            while not bus.sample().reached:
                pass
    return caught.value


@pytest.mark.parametrize("what", GUARDS)
def test_a_watchdog_that_is_changed_in_operation_stops_all_axes_and_is_the_reason(
    what: str, open_bus: Opening, wire: PlantWire
) -> None:
    place, size, value = GUARDS[what]
    node = wire.segment.nodes[2]
    error = ends(open_bus, lambda: node.controller.put(place, size, value), moves=20)
    assert isinstance(error, Tripped)
    assert str(error).startswith("joint 3 (node 3): ")
    assert "another master or tool changed it" in str(error)
    assert "stop that master or tool first" in str(error)
    assert not energised(wire)


@pytest.mark.parametrize("index", [0x6072, 0x607F, 0x6065])
def test_a_limit_that_is_changed_in_operation_is_read_back_and_is_the_reason(
    index: int, open_bus: Opening, wire: PlantWire
) -> None:
    dictionary = wire.segment.nodes[3].dictionary
    error = ends(open_bus, lambda: dictionary.set(index, 0, 60_000), moves=40)
    assert isinstance(error, Tripped)
    assert str(error).startswith(f"joint 4 (node 4): {index:04X}:00")
    assert "is 60000" in str(error)
    assert not energised(wire)


def test_a_session_that_nobody_disturbs_goes_on(open_bus: Opening, wire: PlantWire) -> None:
    asked = []

    def noted(frame: bytes) -> bytes:
        asked.append(reg.WATCHDOG_TIME.to_bytes(2, "little") in frame)
        return frame

    with open_bus() as bus:
        wire.on_the_way = noted
        here = bus.sample().q[0]
        bus.move({0: Move(here + 0.2, 0.5, 2.0)})
        while not bus.sample().reached:
            pass
    assert sum(asked) > 3
    assert bus.notes == ()
