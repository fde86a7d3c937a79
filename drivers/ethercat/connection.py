"""What connecting builds on EtherCAT (`drivers.session.connection.Connection`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.cia402.supervision import Supervision
from drivers.drive_bus import DriveError, NodeSilent
from drivers.ethercat import registers as reg
from drivers.ethercat.access import heard
from drivers.ethercat.al_states import ERROR, MASK, AlState
from drivers.ethercat.communication import EthercatCommunication
from drivers.ethercat.process_data import APART, LOGICAL, EthercatProcessData
from drivers.ethercat.watchdog import OutputsSent
from drivers.remote_dictionary import NoAnswer
from drivers.session.connection import Connection

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.drive_bus import DriveRefused
    from drivers.drives_file import DrivesFile
    from drivers.ethercat.drive import EthercatDrive
    from drivers.ethercat.line import Line
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.sync_clock import SyncClock

START_TIME = 3.0
"""How long drives may take from SAFEOP to OP, outputs coming all the while [s]."""
SETTLING = 3
"""Cycles with outputs before OP is asked for: some drives want valid outputs first."""


class EthercatConnection(Connection):
    """The services of all drives on one line.

    Parameters
    ----------
    line : Line
        That they are on.
    drives : sequence of EthercatDrive
        In joint order.
    servers : sequence of RemoteDictionary
        Their objects.
    clock : SyncClock
        Where the time of a cycle comes from.
    file : DrivesFile
        What is stated of them.
    feed_forward : bool
        The drives are to take offsets of velocity and torque.
    """

    silence = "takes no part in the exchange of process data for {} cycles in a row"
    wiring = "the cables and that no other master is on the line"
    communications: tuple[EthercatCommunication, ...]
    process_data: EthercatProcessData
    life_sign: OutputsSent

    def __init__(
        self,
        line: Line,
        drives: Sequence[EthercatDrive],
        servers: Sequence[RemoteDictionary],
        clock: SyncClock,
        file: DrivesFile,
        *,
        feed_forward: bool,
    ) -> None:
        self._line, self._drives, self._timeout = line, drives, file.heartbeat_timeout
        self._data = data = EthercatProcessData(line, file.axes, drives, clock)
        supervision = Supervision(servers)
        life_sign = OutputsSent(
            data,
            [drive.label for drive in drives],
            file.heartbeat_period,
            file.heartbeat_timeout,
            self._diagnose,
            self._to_op,
        )
        found = tuple(
            EthercatCommunication.wanted(axis, feed_forward=feed_forward) for axis in file.axes
        )
        super().__init__(tuple(servers), found, supervision, data, life_sign)
        for drive, server in zip(drives, servers, strict=True):
            drive.emergencies = _delivering(supervision, server.node)
        line.idle = life_sign.beat

    def conflicts(self) -> Sequence[DriveRefused]:
        """Return none: each drive has its own place in a frame."""
        return ()

    def start(self) -> None:
        """Bring all drives to SAFEOP as they have been set up, and ask for OP."""
        pairs = zip(self._drives, self.communications, strict=True)
        for number, (drive, found) in enumerate(pairs):
            drive.outputs, drive.inputs = found.outputs, found.inputs
            with heard(drive.label):
                drive.prepare(LOGICAL + APART * number, self._timeout)
        alone = self._line.read_all(reg.AL_STATUS, 2).counter == len(self._drives)
        self._data.wire(alone=alone)
        self._keep_held()
        for _ in range(SETTLING):
            self._data.sync()
        for server in self.servers:
            server.access.go_operational()

    def await_answers(self) -> None:
        """Exchange process data until all drives are in OP and take part.

        Raises
        ------
        DriveRefused, NodeSilent
            Which do not get there, with their AL status codes.
        """
        self.supervision.forget()
        self._await_op()
        self.life_sign.watch()

    def _to_op(self) -> None:
        """Bring drives to OP again that have left it."""
        for server in self.servers:
            server.access.go_operational()
        self._await_op()

    def _await_op(self) -> None:
        ends = self._data.now() + START_TIME
        self._data.sync()
        while self._data.unusual or self._data.irregular:
            if self._data.now() > ends or self._refused():
                raise self._diagnose() or NodeSilent(
                    f"not all drives take part in the exchange of process data {START_TIME:g} s"
                    f" after OP was asked for; check {self.wiring}"
                )
            self._data.sync()

    def refuse_unwatched(self) -> None:
        """Refuse drives whose watchdog is not as it was set (see `EthercatDrive`)."""
        for drive in self._drives:
            with heard(drive.label):
                drive.refuse_unwatched()

    def collect_late(self) -> None:
        """Do nothing: a frame that is late is known by its number and dropped."""

    def close(self) -> None:
        """Put back watchdogs and AL states of drives that are shown to be in PREOP."""
        self._line.idle = _nothing
        for drive in self._drives:
            try:
                drive.hand_back()
            except (DriveError, NoAnswer):
                continue  # it keeps its watchdog

    def _keep_held(self) -> None:
        """Have outputs that are mapped beside ours go on to be what the drives hold."""
        for drive, found in zip(self._drives, self.communications, strict=True):
            for entry, value in found.beside:
                drive.carry(entry.index, entry.subindex, value.to_bytes(entry.size, "little"))

    def _refused(self) -> bool:
        """Whether a drive shows an error."""
        return bool(self._line.read_all(reg.AL_STATUS, 2).data[0] & ERROR)

    def _diagnose(self) -> DriveError | None:
        """Return which drives are not in OP, and why; None where all are."""
        problems = []
        for drive in self._drives:
            try:
                status = drive.station.status
                if status & MASK != AlState.OP or status & ERROR:
                    problems.append(f"{drive.label}: shows {drive.station.shown} in operation")
            except (DriveError, NoAnswer):
                continue  # that it is away is counted by the cycle
        if not problems:
            return None
        return NodeSilent(
            f"{'; '.join(problems)}: it takes no outputs, and its watchdog or its own fault"
            " reaction has stopped it; see the AL status code in the drive's manual, and check its"
            " supply and that no other master is on the line"
        )


def _delivering(supervision: Supervision, node: int) -> Callable[[bytes], None]:
    return lambda data: supervision.take_emergency(node, data)


def _nothing() -> None:
    """Do nothing."""
