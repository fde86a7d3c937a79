"""Three small drives on a bus and the driver, used by most tests of the driver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import local_drives
import pytest
from canopen_drive_bus import CanopenDriveBus
from local_bench import NODES, drives_file

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def can_bus() -> Iterator[Any]:
    bus = local_drives.LocalBus(NODES, {})
    yield bus
    bus.shutdown()


@pytest.fixture
def drive_bus(can_bus: Any) -> CanopenDriveBus:
    return CanopenDriveBus(can_bus, drives_file())
