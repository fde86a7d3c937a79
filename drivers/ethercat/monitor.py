"""What can be seen of drives that nobody commands: states, positions, currents, by asking.

On EtherCAT nobody can listen beside a master, so drives are asked by their mailboxes, in PREOP.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.picture import AxisPicture
from drivers.cia402.states import decode_state
from drivers.cia402.supervision import interlock
from drivers.drive_bus import DriveError

if TYPE_CHECKING:
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import UnpoweredDrives

PAUSE = 0.02
"""Between two rounds of questions [s]."""


class LinePicture:
    """What was seen of all axes of a drives file.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order.
    reached : UnpoweredDrives
        Their objects.
    inputs : bool
        Digital inputs are asked for too.

    Attributes
    ----------
    axes : list of AxisPicture
        In joint order.
    """

    def __init__(self, drives: DrivesFile, reached: UnpoweredDrives, *, inputs: bool) -> None:
        self.drives = drives
        self.axes = [AxisPicture(axis.name, axis.node) for axis in drives.axes]
        self._reached, self._inputs = reached, inputs
        self._scales = [AxisScale.of(axis) for axis in drives.axes]

    def listen(self, duration: float) -> None:
        """Ask all drives again and again, for so long [s]."""
        ends = time.monotonic() + duration
        while time.monotonic() < ends:
            for axis, server in enumerate(self._reached.servers):
                try:
                    self._ask(axis, server, self.drives.axes[axis])
                except DriveError:
                    continue  # it shows by when it was heard
            time.sleep(PAUSE)

    def sync_rate(self, now: float) -> float:
        """Return that there are no cycles: this is the master, and sends none."""
        del now
        return 0.0

    def _ask(self, number: int, server: RemoteDictionary, axis: AxisDrive) -> None:
        shown, scale = self.axes[number], self._scales[number]
        shown.state = decode_state(server.get(objects.STATUSWORD))
        shown.q = scale.position_from_counts(float(server.get(objects.POSITION)))
        shown.tau = scale.torque_from_counts(server.measure(axis.current.entry))
        shown.heard = time.monotonic()
        if self._inputs:
            inputs = server.find(objects.DIGITAL_INPUTS)
            shown.interlock = (inputs is not None and interlock(inputs)) or ""
