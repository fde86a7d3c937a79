"""TPDOs delayed by inhibit time, and additional TPDOs by event timer."""

from __future__ import annotations

import pytest
from local_bench import all_off, build, never_energised

from drivers.drive_bus import DriveRefused

INHIBIT, EVENT = (0x1800, 3), (0x1800, 5)


@pytest.mark.parametrize("place", [INHIBIT, EVENT], ids=["inhibit time", "event timer"])
def test_a_tpdo_is_sent_with_each_sync_for_the_session_and_as_before_afterwards(
    place: tuple[int, int],
) -> None:
    can_bus, drive_bus = build({2: {place: ("u16", 300)}})
    held = can_bus.drives[2].node.sdo[place[0]][place[1]]
    with can_bus:
        with drive_bus:
            drive_bus.sample()
            assert held.raw == 0
        assert held.raw == 300
        assert all_off(can_bus)


def test_a_drive_that_keeps_its_inhibit_time_is_refused() -> None:
    can_bus, drive_bus = build({2: {INHIBIT: ("u16", 300)}})
    read_only = 0x06010002
    can_bus.drives[2].forbids = lambda index, sub, _: read_only if (index, sub) == INHIBIT else None
    with can_bus:
        with pytest.raises(DriveRefused, match=r"1800:03 \(inhibit time.*fixed at 300"), drive_bus:
            pytest.fail("the drive was accepted")
        assert never_energised(can_bus)
