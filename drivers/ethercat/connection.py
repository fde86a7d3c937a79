"""Services of EtherCAT drives (`drivers.session.connection.Connection`)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveError, NodeSilent
from drivers.ethercat import registers as reg
from drivers.ethercat.clocks import AHEAD, Clocks, ReferenceClock
from drivers.ethercat.communication import EthercatCommunication, offers_sync0, synchronise
from drivers.ethercat.drive import make_drives, name_drive
from drivers.ethercat.process_data import APART, LOGICAL, EthercatProcessData
from drivers.ethercat.registers import ERROR, MASK, AlState
from drivers.ethercat.slaves import Slaves
from drivers.ethercat.watchdog import OutputsSent
from drivers.remote_dictionary import NoAnswer
from drivers.session.connection import Connection, places_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drives_file import DrivesFile
    from drivers.ethercat.line import Line
    from drivers.sync_clock import SyncClock

START_TIME = 3.0
"""Longest time of drives from SAFEOP to OP with continuous outputs [s]."""
OUT_OF_CYCLE = (
    "the drives' clocks differ, or frames are outside their cycles (stop other programs, use "
    "--realtime, or state distributed_clock: false)"
)
SETTLING = 3
"""Cycles with outputs before OP is requested: some drives require valid outputs first."""


class EthercatConnection(Connection):
    """Services of the drives on a line.

    Parameters
    ----------
    line : Line
    clock : SyncClock
        Source of the cycle time.
    file : DrivesFile
    feed_forward : bool
        True if the drives take offsets of velocity and torque.
    """

    silence = "takes no part in the exchange of process data for {} cycles in a row"
    wiring = "the cables and that no other master is on the line"
    doubling = "no SYNC0 passed between frames for {} cycles in a row: " + OUT_OF_CYCLE
    requests_delay = False
    communications: tuple[EthercatCommunication, ...]
    process_data: EthercatProcessData
    life_sign: OutputsSent

    def __init__(
        self, line: Line, clock: SyncClock, file: DrivesFile, *, feed_forward: bool
    ) -> None:
        self._line, self._slaves = line, Slaves(line)
        places = places_of(file.axes)
        drives, servers = make_drives(line, self._slaves, places, file.sdo_timeout)
        self._drives = drives
        self._timeout = file.heartbeat_timeout
        self._clock: ReferenceClock | None = None
        if isinstance(clock, ReferenceClock) and file.distributed_clock:
            self._clock = clock
        self._clocks: Clocks | None = None
        self._data = data = EthercatProcessData(line, file.axes, drives, clock)
        life_sign = OutputsSent(
            data,
            [drive.label for drive in drives],
            file.heartbeat_period,
            file.heartbeat_timeout,
            self._diagnose,
            self._restore_op,
        )
        found = tuple(
            EthercatCommunication.prefer(axis, feed_forward=feed_forward) for axis in file.axes
        )
        super().__init__(servers, found, data, life_sign)
        for drive, server in zip(drives, servers, strict=True):
            drive.emergencies = partial(self.supervision.take_emergency, server.node)
        line.idle = life_sign.beat

    def start(self) -> None:
        """Bring the configured drives to SAFEOP, and request OP."""
        self._set_clocks()
        pairs = zip(self._drives, self.communications, strict=True)
        for number, (drive, found) in enumerate(pairs):
            drive.outputs, drive.inputs = found.outputs, found.inputs
            # the next possible SYNC0 of a drive, and its cycle [ns]
            sync0 = None
            if self._clock is not None and self._clocks is not None:
                sync0 = self._clock.first_sync0(self._clocks.now())
            with name_drive(drive.label):
                drive.prepare(LOGICAL + APART * number, self._timeout, sync0)
        alone = self._line.read_all(reg.AL_STATUS, 2).counter == len(self._drives)
        self._data.wire(self._clocks, alone=alone)
        for drive, found in zip(self._drives, self.communications, strict=True):
            for entry, value in found.beside:  # further outputs keep the drive's values
                drive.carry(entry.index, entry.subindex, entry.data(value))
        ends = self._data.now() + (2 * AHEAD if self._clocks else 0.0)
        for _ in range(SETTLING):
            self._data.sync()
        while self._data.now() < ends:  # some drives require SYNC0 first
            self._data.sync()
        for server in self.servers:
            server.access.go_operational()

    def await_answers(self) -> None:
        """Exchange process data until every drive is in OP and takes part.

        Raises
        ------
        DriveRefused, NodeSilent
            Drives that do not reach OP, with their AL status codes.
        """
        self.supervision.forget()
        self._await_op()
        self._data.farthest = 0.0
        self.life_sign.watch()

    def _restore_op(self) -> None:
        """Bring drives back to OP."""
        for server in self.servers:
            server.access.go_operational()
        self._await_op()

    def _await_op(self) -> None:
        ends = self._data.now() + START_TIME
        self._data.sync()
        while self._data.unusual or self._data.irregular:
            refused = self._line.read_all(reg.AL_STATUS, 2).data[0] & ERROR
            if self._data.now() > ends or refused:
                why = f"{OUT_OF_CYCLE},"
                if self._clocks is None or self._data.unusual:
                    why = "not all drives take part in the exchange of process data"
                raise self._diagnose() or NodeSilent(
                    f"{why} {START_TIME:g} s after OP was requested; check {self.wiring}"
                )
            self._data.sync()

    def refuse_unwatched(self) -> None:
        """Refuse drives whose watchdog was changed (see `EthercatDrive`)."""
        for drive in self._drives:
            with name_drive(drive.label):
                drive.refuse_unwatched()

    def collect_late(self) -> None:
        """Do nothing: a late frame has an old number and is dropped."""

    def close(self) -> None:
        """Restore watchdogs and AL states of drives confirmed to be in PREOP."""
        self._line.idle = lambda: None
        for drive in self._drives:
            try:
                drive.hand_back()
            except (DriveError, NoAnswer):
                continue  # the watchdog is kept

    def remarks(self) -> Sequence[str]:
        """Describe the agreement of the clocks, if drives follow a reference."""
        clock, clocks = self._clock, self._clocks
        if clock is None or clocks is None:
            return ()
        faster = "faster" if clock.skew > 0 else "slower"
        return (
            f"distributed clock: slave {clocks.reference.position} is the reference, "
            f"{1e6 * abs(clock.skew):.1f} ppm {faster} than this computer; {len(clocks.clocked)} "
            f"clocks agree within {1e9 * self._data.farthest:.0f} ns, the last at a cable delay "
            f"of {clocks.delay} ns; SYNC0 {1e3 * clock.shift:g} ms after the nominal time of "
            "frames",
        )

    def _set_clocks(self) -> None:
        """Synchronise the clocks on the line, if every drive can follow a reference."""
        if self._clock is None:
            return
        with name_drive("the clocks of the slaves"):
            clocks = Clocks(self._line, self._slaves.all)
            clocked = all(drive.station in clocks.clocked for drive in self._drives)
            clocked = clocked and all(map(offers_sync0, self.servers))
            if clocked:
                self._clocks = clocks
                self._clock.begin(*clocks.settle(self._clock.host))
        for server in self.servers:
            synchronise(server, clocked=clocked)

    def _diagnose(self) -> DriveError | None:
        """Return an error for drives that are not in OP; None if absent."""
        problems = []
        for drive in self._drives:
            try:
                status = drive.station.status
                if status & MASK != AlState.OP or status & ERROR:
                    problems.append(f"{drive.label}: shows {drive.station.shown} instead of OP")
            except (DriveError, NoAnswer):
                continue  # absence is detected in the cycle
        if not problems:
            return None
        return NodeSilent(
            f"{'; '.join(problems)}: outputs are refused, and its watchdog or fault reaction has "
            "stopped the drive; see the AL status code in the drive's manual, and check its "
            "supply and that no other master is on the line"
        )
