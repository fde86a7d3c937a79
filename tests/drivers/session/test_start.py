"""Drives that are slow from NMT start to OPERATIONAL, or never reach it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from local_bench import all_off, build, never_energised

from drivers.drive_bus import NodeSilent

if TYPE_CHECKING:
    import can

PRE_OPERATIONAL = b"\x7f"
NODE = 2
STARTED = bytes([1, NODE])


class Late:
    """Second drive whose node stays pre-operational for this number of SYNCs after NMT start."""

    def __init__(self, can_bus: Any, syncs: float) -> None:
        self.can_bus, self.syncs = can_bus, syncs
        self.starts = 0
        self.drive = can_bus.drives[NODE]
        can_bus.on_send = self.handle_sent

    def handle_sent(self, frame: can.Message) -> None:
        if frame.arbitration_id == 0 and bytes(frame.data) == STARTED:
            self.starts += 1
        elif frame.arbitration_id == 0x80 and self.starts:
            self.syncs -= 1
            if self.syncs > 0:
                self.drive.node.nmt.state = "PRE-OPERATIONAL"
                if self.syncs % 25 == 0:
                    self.can_bus.network.emit(0x700 + NODE, PRE_OPERATIONAL)
            elif self.starts > 1:
                self.drive.node.nmt.state = "OPERATIONAL"


def test_a_drive_that_says_pre_operational_for_a_while_after_the_start_serves() -> None:
    can_bus, drive_bus = build()
    late = Late(can_bus, 100)  # 0.4 s
    with can_bus, drive_bus:
        assert drive_bus.sample().flags == (0, 0, 0)
        assert late.starts == 4  # at 0, 0.1, 0.2 and 0.3 s


def test_a_drive_that_never_becomes_operational_is_named_and_nothing_is_energised() -> None:
    can_bus, drive_bus = build()
    Late(can_bus, 1e9)
    with can_bus:
        with pytest.raises(NodeSilent, match=r"^joint 2 .*not operational 2 s after NMT start"):
            drive_bus.__enter__()
        assert never_energised(can_bus)
        assert all_off(can_bus)


def test_a_drive_that_becomes_pre_operational_once_it_was_not_stops_all_axes() -> None:
    can_bus, drive_bus = build()
    with can_bus, drive_bus:
        for _ in range(30):  # each node reports the operational state in this time
            drive_bus.sample()
        can_bus.network.emit(0x700 + NODE, PRE_OPERATIONAL)
        with pytest.raises(NodeSilent, match="is pre-operational during operation"):
            drive_bus.sample()
