"""What a drive shows of its motor's effort in two objects, read side by side while an axis works.

Nearly every drive shows its torque (6077) beside its current (6078, or a maker's own object). The
two are one quantity in two units, so their ratio shows the unit of the one that is measured. Both
are read by SDO, one right after the other, now and then during rest and slow strokes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from drivers.canopen.pdo_mapping import current_entry
from drivers.dictionary import probed_objects as probed
from drivers.drive_bus import DriveRefused

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.drives_file import AxisDrive

POLLED = 0.05
"""Time between two readings [s]."""


class CurrentReadings:
    """Pairs of counts of one axis.

    Parameters
    ----------
    server : RemoteDictionary
        The drive.
    axis : AxisDrive
        What the drives file states.
    """

    def __init__(self, server: RemoteDictionary, axis: AxisDrive) -> None:
        self._server = server
        self._entries = (probed.TORQUE, current_entry(axis))
        alone = axis.current.index == probed.TORQUE.index
        self._next = math.inf if alone else -math.inf
        self._pairs: list[tuple[int, int]] = []

    @property
    def counts(self) -> NDArray[np.float64]:
        """Counts of 6077 and of the object that is measured, shape (n, 2)."""
        return np.array(self._pairs, dtype=float).reshape(-1, 2)

    def poll(self, time: float) -> None:
        """Read both if it is time; a drive that lacks one of them is not asked again."""
        if time < self._next:
            return
        try:
            torque, measured = (self._server.find(entry) for entry in self._entries)
        except DriveRefused:
            torque = measured = None
        if torque is None or measured is None:
            self._next = math.inf
            return
        self._next = time + POLLED
        self._pairs.append((torque, measured))
