"""Picture of idle drives: states, positions, currents, by requests.

Passive listening is impossible on EtherCAT, so the mailboxes of the drives are read, in PREOP.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.picture import Picture
from drivers.drive_bus import DriveError
from drivers.ethercat.process_layout import inputs_of

if TYPE_CHECKING:
    from drivers.drives_file import DrivesFile
    from drivers.session.connection import UnpoweredDrives

PAUSE = 0.02
"""Time between two rounds of requests [s]."""


class LinePicture(Picture):
    """Picture of the axes of a drives file.

    Parameters
    ----------
    drives : DrivesFile
        Axes in joint order.
    reached : UnpoweredDrives
        Access to their objects.
    inputs : bool
        True to read digital inputs too.
    """

    def __init__(self, drives: DrivesFile, reached: UnpoweredDrives, *, inputs: bool) -> None:
        super().__init__(drives)
        self._reached, self._inputs = reached, inputs

    def listen(self, duration: float) -> None:
        """Read all drives repeatedly for a duration [s]."""
        ends = time.monotonic() + duration
        while time.monotonic() < ends:
            for axis, server in zip(self.axes, self._reached.servers, strict=True):
                try:
                    for entry in inputs_of(axis.drive):
                        axis.show(entry, server.measure(entry))
                    axis.heard = time.monotonic()
                    if self._inputs:
                        axis.show(objects.DIGITAL_INPUTS, server.find(objects.DIGITAL_INPUTS) or 0)
                except DriveError:
                    continue  # the time of the last answer shows it
            time.sleep(PAUSE)

    def sync_rate(self, now: float) -> float:
        """Return 0: this is the master, and sends no cycles."""
        del now
        return 0.0
