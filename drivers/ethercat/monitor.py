"""What can be seen of drives that nobody commands: states, positions, currents, by asking.

On EtherCAT nobody can listen beside a master, so drives are asked by their mailboxes, in PREOP.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.cia402 import objects
from drivers.cia402.picture import Picture
from drivers.drive_bus import DriveError
from drivers.ethercat.process_layout import inputs_of

if TYPE_CHECKING:
    from drivers.cia402.picture import AxisPicture
    from drivers.drives_file import DrivesFile
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import UnpoweredDrives

PAUSE = 0.02
"""Between two rounds of questions [s]."""


class LinePicture(Picture):
    """What was seen of all axes of a drives file.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order.
    reached : UnpoweredDrives
        Their objects.
    inputs : bool
        Digital inputs are asked for too.
    """

    def __init__(self, drives: DrivesFile, reached: UnpoweredDrives, *, inputs: bool) -> None:
        super().__init__(drives)
        self._reached, self._inputs = reached, inputs

    def listen(self, duration: float) -> None:
        """Ask all drives again and again, for so long [s]."""
        ends = time.monotonic() + duration
        while time.monotonic() < ends:
            for axis, server in zip(self.axes, self._reached.servers, strict=True):
                try:
                    self._ask(axis, server)
                except DriveError:
                    continue  # it shows by when it was heard
            time.sleep(PAUSE)

    def sync_rate(self, now: float) -> float:
        """Return that there are no cycles: this is the master, and sends none."""
        del now
        return 0.0

    def _ask(self, axis: AxisPicture, server: RemoteDictionary) -> None:
        for entry in inputs_of(axis.drive):
            axis.show(entry, server.measure(entry))
        axis.heard = time.monotonic()
        if self._inputs:
            axis.show(objects.DIGITAL_INPUTS, server.find(objects.DIGITAL_INPUTS) or 0)
