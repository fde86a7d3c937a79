"""Axes whose process data stay away or come twice: one sample is a gap, ten are no control.

In lock-step nothing arrives unless something is sent. So after a gap our heartbeat goes out early
(`collect_late`): a TPDO that was merely late comes with it, is flagged as late and dropped, and is
not taken for the answer to the next SYNC.
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
"""SYNCs in a row without an axis's TPDO after which all axes are stopped."""
BUSY = 0.25
"""Time for which they may stay away at least where this computer is late itself, so perhaps what
hands them over [s]."""


class MissingTelegrams:
    """Counts the SYNCs that an axis left unanswered.

    Parameters
    ----------
    axes : sequence of Axis
        In joint order.
    collect_late : callable
        Takes telegrams off the bus that are merely late; called after a gap.
    period : float
        Time between two SYNCs [s].
    silence, wiring : str
        What stays away for so many SYNCs, in words, and what to check of the bus then.
    doubling : str
        See `drivers.session.connection.Connection`.

    Attributes
    ----------
    open : bool
        The last sample had a gap.
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
        self._axes = axes
        self._collect_late = collect_late
        self._counts = [0] * len(axes)
        self._doubled = [0] * len(axes)

    @property
    def blind(self) -> bool:
        """Nobody has seen some axis for more than one SYNC."""
        return self.open and max(self._counts) > 1

    def look(
        self, flags: Sequence[int], misfits: Mapping[int, str], *, busy: bool = False
    ) -> DriveError | None:
        """Take the flags of a sample; return which axis we are blind for, if any.

        Parameters
        ----------
        misfits : mapping of int to str
            By axis, what came in place of its telegram.
        busy : bool
            This computer was late just now.
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
