"""What can be seen of drives by listening alone: states, positions, torques, emergencies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.cia402.error_codes import Emergency
    from drivers.cia402.states import State


@dataclass(slots=True)
class AxisPicture:
    """What was seen of one axis last.

    Attributes
    ----------
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

    name: str
    node: int
    heard: float = -math.inf
    nmt: str = ""
    state: State | None = None
    q: float = math.nan
    tau: float = math.nan
    interlock: str = ""
    emergency: Emergency | None = None
    emergencies: int = 0
    foreign: int = 0


class Picture(Protocol):
    """What was seen of all axes of a drives file, by a bus that is listened to.

    Attributes
    ----------
    axes : sequence of AxisPicture
        In joint order.
    """

    @property
    def axes(self) -> Sequence[AxisPicture]: ...  # noqa: D102 - an attribute

    def listen(self, duration: float) -> None:
        """Take what comes, for so long [s]."""

    def sync_rate(self, now: float) -> float:
        """Rate of the last SYNCs [1/s], 0 if there are none any more at `now` [s]."""
