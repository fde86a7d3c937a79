"""Our sign of life: the outputs that feed the watchdogs of all drives' sync managers.

Each cycle brings outputs, so there is nothing to send beside. Only while a mailbox is waited for,
and no cycle passes, the same outputs go out again when they are due. In the other direction a
drive that leaves OP, or does not take part in the exchange for the time-out, is trouble, and so is
one whose watchdog is no longer as it was set: it is read with every `heartbeat_period`. Where the
sign ceases, inputs are read on and outputs are not sent any more, to any drive.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused, NodeSilent

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drive_bus import DriveError
    from drivers.ethercat.process_data import EthercatProcessData


class OutputsSent:
    """Our sign of life and theirs (`drivers.fieldbus.LifeSign`).

    Parameters
    ----------
    data : EthercatProcessData
        Of all axes.
    labels : sequence of str
        How messages name the drives.
    period, timeout : float
        How often outputs are sent at least, and how long they may stay away [s].
    diagnose : callable
        Returns what is wrong where drives are not all in OP; None where they are.
    recover : callable
        Brings drives to OP that have left it.
    """

    name = "our process data"

    def __init__(
        self,
        data: EthercatProcessData,
        labels: Sequence[str],
        period: float,
        timeout: float,
        diagnose: Callable[[], DriveError | None],
        recover: Callable[[], None],
    ) -> None:
        self.timeout = timeout
        self.trouble: DriveError | None = None
        self._data, self._labels, self._period = data, labels, period
        self._diagnose, self._recover = diagnose, recover
        self._watched, self._looks = False, math.inf

    @property
    def due(self) -> float:
        """When `service` must be called next [s]: at once where something is unusual."""
        data = self._data
        return -math.inf if data.unusual or data.mail or data.foreign else self._looks

    def watch(self) -> None:
        """Begin to expect all drives in OP, and to send outputs again."""
        self.trouble, self._watched = None, True
        self._looks = self._data.now() + self._period
        self._data.feeding = True
        self._data.forget_absence()
        if self._data.fallen:
            self._recover()

    def service(self) -> None:
        """Take mail, and look who has left OP or is away."""
        self.beat()
        if self._data.mail:
            self._data.collect_mail()
        if not self._watched or self.trouble is not None:
            return
        if self._data.foreign:
            self.trouble = NodeSilent(
                "another master sends on this interface: the drives would follow both, and their"
                " watchdogs would not miss us; end that master"
            )
        elif self._data.unusual:
            self._look_who_is_gone()
        elif self._data.now() >= self._looks:
            self._looks = self._data.now() + self._period
            if unwatched := self._data.unwatched():
                self.trouble = DriveRefused(
                    f"{unwatched}: somebody else changed it, and the axis would go on when our"
                    " process dies; nobody else may command these drives: end that master or tool"
                    " first"
                )

    def _look_who_is_gone(self) -> None:
        if self._data.fallen:
            self.trouble = self._diagnose()
        if self.trouble is None and self._data.absence >= self.timeout:
            away = "; ".join(self._labels[axis] for axis in self._data.absent)
            self.trouble = NodeSilent(
                f"{away}: takes no part in the exchange of process data for"
                f" {self._data.absence:.3g} s (limit {self.timeout:g} s); check the drive's supply"
                " and the cables"
            )

    def beat(self) -> None:
        """Send the present outputs again if none have gone out for the period."""
        if self._data.feeding and self._data.since_sent() >= self._period:
            self._data.repeat()

    def cease(self) -> None:
        """Send outputs no more: the watchdogs of the drives take them out of OP."""
        self._data.feeding = False
