"""Sign of life on EtherCAT: outputs that feed the watchdogs of the drives' sync managers.

Each cycle sends outputs, so no separate sign is necessary. Only during waits for a mailbox, without
cycles, the present outputs are repeated when due. In the other direction, a drive that leaves OP,
or is absent for the time-out, is a failure, and so is a changed watchdog, which is read with every
`heartbeat_period`. After the end of the sign, inputs are still read, but no drive gets outputs.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import NodeSilent, Tripped

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drive_bus import DriveError
    from drivers.ethercat.process_data import EthercatProcessData


class OutputsSent:
    """Mutual supervision by outputs and states (`drivers.fieldbus.LifeSign`).

    Parameters
    ----------
    data : EthercatProcessData
    labels : sequence of str
        Names of the drives in messages.
    period, timeout : float
        Longest time between outputs, and longest absence [s].
    diagnose : callable
        Returns an error if drives are not in OP; None if they are.
    recover : callable
        Brings drives back to OP.
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
        """Time of the next call of `service` [s]: immediately in unusual states."""
        data = self._data
        return -math.inf if data.unusual or data.mail or data.foreign else self._looks

    def watch(self) -> None:
        """Start to supervise the drives in OP, and to send outputs again."""
        self.trouble, self._watched = None, True
        self._looks = self._data.now() + self._period
        self._data.feeding = True
        self._data.forget_absence()
        if self._data.fallen:
            self._recover()

    def service(self) -> None:
        """Receive mailbox services, and check for drives that have left OP or are absent."""
        self.beat()
        if self._data.mail:
            self._data.collect_mail()
        if not self._watched or self.trouble is not None:
            return
        if self._data.foreign:
            self.trouble = NodeSilent(
                "another master sends on this interface: drives would follow both, and watchdogs "
                "would not detect the loss of this program; stop the other master"
            )
        elif self._data.unusual:
            self._judge_absence()
        elif self._data.now() >= self._looks:
            self._looks = self._data.now() + self._period
            if unwatched := self._data.find_unwatched():
                self.trouble = Tripped(
                    f"{unwatched}: another master or tool changed it, and the axis would keep "
                    "moving after a crash of this program; stop that master or tool first"
                )

    def _judge_absence(self) -> None:
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
        """Repeat the present outputs if none were sent for the period."""
        if self._data.feeding and self._data.since_sent() >= self._period:
            self._data.repeat()

    def cease(self) -> None:
        """Stop the outputs: the watchdogs take the drives out of OP."""
        self._data.feeding = False
