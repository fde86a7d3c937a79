"""Drives that are not powered: their dictionaries, and time passing meanwhile.

Before anything is switched on the drives are asked what they are, and after they were switched off
it is watched whether their brakes hold. Neither needs process data or heartbeats: `UnpoweredDrives`
has an SDO client for each drive, and lets time pass by SYNC where SYNC is the plant's clock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.communication import Communication
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.process_data import SyncProcessData
from drivers.canopen.sdo import RemoteDictionary
from drivers.canopen.sync_clock import choose_sync_clock

if TYPE_CHECKING:
    import can

    from drivers.canopen.sync_clock import PacingName
    from drivers.drives_file import DrivesFile


class UnpoweredDrives:
    """The drives of a file, as they are before or after a session of `CanopenDriveBus`.

    Parameters
    ----------
    bus : can.BusABC
        An open bus on which nobody else receives from this object.
    drives : DrivesFile
        The axes in joint order.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.

    Attributes
    ----------
    network : PumpedNetwork
        The bus.
    process_data : SyncProcessData
        Lets time pass; the drives send none.
    servers : tuple of RemoteDictionary
        The drives' object dictionaries in joint order.
    """

    def __init__(self, bus: can.BusABC, drives: DrivesFile, pacing: PacingName = "auto") -> None:
        clock = choose_sync_clock(bus, pacing, drives.sync_period)
        self.network = PumpedNetwork(bus, synchronous=clock.synchronous)
        predefined = [Communication.predefined(axis, axis.name) for axis in drives.axes]
        self.process_data = SyncProcessData(self.network, drives.axes, clock, predefined)
        self.servers = tuple(
            RemoteDictionary(self.network, axis.node, axis.name, drives.sdo_timeout)
            for axis in drives.axes
        )

    def wait(self, duration: float) -> None:
        """Let time pass [s]."""
        ends = self.process_data.now() + duration
        while self.process_data.now() < ends:
            self.process_data.tick()
