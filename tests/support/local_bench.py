"""Three small drives on a bus, with their drives file and the driver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import local_drives
import pytest
import stated_axis
from canopen_drive_bus import CanopenDriveBus

if TYPE_CHECKING:
    from drivers.drive_bus import DriveError
    from drivers.drives_file import DrivesFile

NODES = 3
ENERGISED = {"enabled", "stopping"}


def axis(node: int, **changes: Any) -> dict[str, Any]:
    own = {
        "name": f"joint {node}",
        "node": node,
        "identity": {"vendor": 0x4D2, "product": 0x402},
        "sign": 1 if node % 2 else -1,
        "zero": 500 * (node - 1),
        "rated_torque": 1.0,
        "limits": {"q_min": -2, "q_max": 2, "velocity": 2, "acceleration": 20, "torque": 300},
    }
    return stated_axis.axis(**{**own, **changes})


def drives_file(**changes: Any) -> DrivesFile:
    return stated_axis.drives(*(axis(node, **changes) for node in range(1, NODES + 1)))


def build(
    changes: dict[int, dict[tuple[int, int], Any]] | None = None, **options: Any
) -> tuple[Any, CanopenDriveBus]:
    """Return local drives with some objects changed (None: missing), and
    the driver on their bus.
    """
    can_bus = local_drives.LocalBus(NODES, changes or {})
    return can_bus, CanopenDriveBus(can_bus, drives_file(), **options)


def never_energised(can_bus: Any) -> bool:
    return not any(ENERGISED & set(drive.history) for drive in can_bus.drives.values())


def all_off(can_bus: Any) -> bool:
    return all(drive.state in {"off", "fault"} for drive in can_bus.drives.values())


def refused(changes: dict[int, dict[tuple[int, int], Any]], error: type[DriveError]) -> str:
    """Enter a session with changed drives; return the refusal after
    checking that none had power.
    """
    can_bus, drive_bus = build(changes)
    with can_bus:
        with pytest.raises(error) as caught, drive_bus:
            pytest.fail("the drives were accepted")
        assert never_energised(can_bus)
        assert all_off(can_bus)
    return str(caught.value)
