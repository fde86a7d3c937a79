"""Picture of drives for a passive observer: states, positions, torques, emergencies."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.cia402.states import decode_state
from drivers.cia402.supervision import interlock

if TYPE_CHECKING:
    from drivers.cia402.error_codes import Emergency
    from drivers.cia402.states import State
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry


@dataclass(slots=True)
class AxisPicture:
    """Last observation of an axis.

    Attributes
    ----------
    drive : AxisDrive
        Axis as stated in the drives file.
    name : str
    node : int
    heard : float
        Time of the drive's last frame [s]; -inf if none came.
    nmt : str
        NMT state, from the heartbeat.
    state : State or None
        State, from the statusword; None while unknown.
    q, tau : float
        Position [rad or m] and torque [N m or N]; NaN while unknown.
    interlock : str
        State of an interlock by the digital inputs (60FD), if these are read.
    emergency : Emergency or None
        Last emergency, until the drive reports its end.
    emergencies, foreign : int
        Number of emergencies, and of TPDOs with another mapping.
    """

    drive: AxisDrive
    name: str = field(init=False)
    node: int = field(init=False)
    _scale: AxisScale = field(init=False)
    heard: float = -math.inf
    nmt: str = ""
    state: State | None = None
    q: float = math.nan
    tau: float = math.nan
    interlock: str = ""
    emergency: Emergency | None = None
    emergencies: int = 0
    foreign: int = 0

    def __post_init__(self) -> None:
        self.name, self.node = self.drive.name, self.drive.node
        self._scale = AxisScale.derive(self.drive)

    def show(self, entry: Entry, value: float) -> None:
        """Store the value of an object of the drive."""
        if entry == objects.STATUSWORD:
            self.state = decode_state(int(value))
        elif entry == objects.POSITION:
            self.q = self._scale.position_from_counts(float(value))
        elif entry == self.drive.current.entry:
            self.tau = self._scale.torque_from_counts(float(value))
        elif entry == objects.DIGITAL_INPUTS:
            self.interlock = interlock(int(value)) or ""


class Picture(ABC):
    """Picture of the axes of a drives file, by listening or by requests.

    Parameters
    ----------
    drives : DrivesFile
        Axes in joint order.

    Attributes
    ----------
    axes : list of AxisPicture
        Pictures in joint order.
    """

    def __init__(self, drives: DrivesFile) -> None:
        self.axes = [AxisPicture(axis) for axis in drives.axes]

    @abstractmethod
    def listen(self, duration: float) -> None:
        """Receive frames for a duration [s]."""

    @abstractmethod
    def sync_rate(self, now: float) -> float:
        """Return the rate of the last SYNCs [1/s], 0 if SYNC has ended at `now` [s]."""
