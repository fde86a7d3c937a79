"""Drives that are not powered: their dictionaries, and time passing meanwhile.

Before anything is switched on the drives are asked what they are, and after they were switched off
it is watched whether their brakes hold. Neither needs process data or heartbeats: `StandingDrives`
has an SDO client for each drive, and lets time pass by SYNC where SYNC is the plant's clock.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.network import PumpedNetwork
from drivers.canopen.process_data import SYNC
from drivers.canopen.sdo import SdoServer
from drivers.canopen.sync_clock import choose_pacing

if TYPE_CHECKING:
    import can

    from drivers.canopen.sync_clock import PacingName
    from drivers.drives_file import DrivesFile


class StandingDrives:
    """The drives of a file, as they are before or after a session of `CanopenDriveBus`.

    Parameters
    ----------
    bus : can.BusABC
        An open bus on which nobody else receives from this object.
    drives : DrivesFile
        The axes in joint order.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_pacing`.

    Attributes
    ----------
    network : PumpedNetwork
        The bus.
    servers : tuple of SdoServer
        The drives' object dictionaries in joint order.
    """

    def __init__(self, bus: can.BusABC, drives: DrivesFile, pacing: PacingName = "auto") -> None:
        self._pacing = choose_pacing(bus, pacing, drives.sync_period)
        self.network = PumpedNetwork(bus, synchronous=self._pacing.synchronous)
        self.servers = tuple(
            SdoServer(self.network, axis.node, axis.name, drives.sdo_timeout)
            for axis in drives.axes
        )

    def wait(self, duration: float) -> None:
        """Let time pass [s]."""
        ends = self._pacing.now() + duration
        while self._pacing.now() < ends:
            self.network.pump(self._pacing.due())
            self.network.send_frame(SYNC)
            self._pacing.sent()
            self.network.pump(0.0)
