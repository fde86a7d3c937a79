"""What can be seen of drives by listening alone: states, positions, torques, emergencies."""

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
    """What was seen of one axis last.

    Attributes
    ----------
    drive : AxisDrive
        What the drives file states of it.
    name : str
    node : int
    heard : float
        When any frame of the drive came last [s]; -inf if none ever did.
    nmt : str
        From its heartbeat.
    state : State or None
        From the statusword; None while unknown.
    q, tau : float
        [rad or m], [N m or N]; NaN while unknown.
    interlock : str
        What its digital inputs (60FD) say of an interlock, if anybody asks for them.
    emergency : Emergency or None
        The last one, until the drive reports its end.
    emergencies, foreign : int
        How many emergencies came, and how many TPDOs that are not mapped as ours.
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
        self._scale = AxisScale.of(self.drive)

    def show(self, entry: Entry, value: float) -> None:
        """Take what an object of the drive holds."""
        if entry == objects.STATUSWORD:
            self.state = decode_state(int(value))
        elif entry == objects.POSITION:
            self.q = self._scale.position_from_counts(float(value))
        elif entry == self.drive.current.entry:
            self.tau = self._scale.torque_from_counts(float(value))
        elif entry == objects.DIGITAL_INPUTS:
            self.interlock = interlock(int(value)) or ""


class Picture(ABC):
    """What was seen of all axes of a drives file, by a bus that is listened to, or asked.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order.

    Attributes
    ----------
    axes : list of AxisPicture
        In joint order.
    """

    def __init__(self, drives: DrivesFile) -> None:
        self.axes = [AxisPicture(axis) for axis in drives.axes]

    @abstractmethod
    def listen(self, duration: float) -> None:
        """Take what comes, for so long [s]."""

    @abstractmethod
    def sync_rate(self, now: float) -> float:
        """Rate of the last SYNCs [1/s], 0 if there are none any more at `now` [s]."""
