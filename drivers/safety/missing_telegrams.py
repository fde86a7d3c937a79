"""Detection of missing and doubled process data: one is a gap, ten are a loss of control.

In lock-step nothing arrives unless something is sent. Hence our heartbeat is sent early after a gap
(`collect_late`): a late TPDO arrives with it, is flagged as late and dropped, and is not mistaken
for the answer to the next SYNC.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import NodeSilent, SampleFlag, Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from drivers.axis import Axis
    from drivers.drive_bus import DriveError

BLIND = 10
"""Consecutive SYNCs without an axis's TPDO until all axes are stopped."""
BUSY = 0.25
"""Minimum time without TPDOs while this computer itself is late, since their delivery may be late
too [s]."""


class MissingTelegrams:
    """Counter of unanswered SYNCs, for each axis.

    Parameters
    ----------
    axes : sequence of Axis
        In joint order.
    collect_late : callable
        Receives late telegrams; called after a gap.
    period : float
        Time between two SYNCs [s].
    silence, wiring : str
        Parts of the message: what is missing, and what to check of the bus.
    doubling : str
        See `drivers.session.connection.Connection`.

    Attributes
    ----------
    open : bool
        True if the last sample had a gap.
    """

    def __init__(
        self,
        axes: Sequence[Axis],
        collect_late: Callable[[], None],
        period: float,
        silence: str,
        wiring: str,
        doubling: str,
    ) -> None:
        self._silence, self._wiring, self._doubling = silence, wiring, doubling
        self._busy = max(BLIND, math.ceil(BUSY / period))
        self.open = False
        self._axes, self._collect_late = axes, collect_late
        self._counts = [0] * len(axes)
        self._doubled = [0] * len(axes)

    @property
    def blind(self) -> bool:
        """True if an axis has been unobserved for more than one SYNC."""
        return self.open and max(self._counts) > 1

    def look(
        self, flags: Sequence[int], misfits: Mapping[int, str], *, busy: bool = False
    ) -> DriveError | None:
        """Check the flags of a sample; return an error if an axis is unobserved for too long.

        Parameters
        ----------
        misfits : mapping of int to str
            Description of the telegram that arrived instead of the expected one, by axis.
        busy : bool
            True if this computer was late just now.
        """
        most = self._busy if busy else BLIND
        for axis in self._axes:
            gone = flags[axis.index] & SampleFlag.MISSING
            self._counts[axis.index] = self._counts[axis.index] + 1 if gone else 0
            twice = flags[axis.index] & SampleFlag.DOUBLED
            self._doubled[axis.index] = self._doubled[axis.index] + 1 if twice else 0
        self.open = any(self._counts)
        if self.open:
            self._collect_late()
        if max(self._doubled) >= BLIND:
            labels = ", ".join(a.label for a in self._axes if self._doubled[a.index] >= BLIND)
            return Tripped(f"{labels}: {self._doubling.format(BLIND)}")
        blind = [axis.label for axis in self._axes if self._counts[axis.index] >= most]
        if not blind:
            return None
        found = [misfits[axis.index] for axis in self._axes if axis.index in misfits]
        why = f"; {'; '.join(found)}" if found else ""
        return NodeSilent(
            f"{', '.join(blind)}: {self._silence.format(most)}{why}; check the drive's supply, "
            f"{self._wiring}"
        )
