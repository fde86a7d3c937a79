"""What connecting builds on EtherCAT (`drivers.session.connection.Connection`)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveError, NodeSilent, Tripped
from drivers.ethercat import registers as reg
from drivers.ethercat.al_states import ERROR, MASK, AlState
from drivers.ethercat.clocks import Clocks
from drivers.ethercat.communication import EthercatCommunication, offers_sync0, synchronise
from drivers.ethercat.drive import heard, reached
from drivers.ethercat.process_data import APART, LOGICAL, EthercatProcessData
from drivers.ethercat.reference_clock import AHEAD, ReferenceClock
from drivers.ethercat.slaves import Slaves
from drivers.ethercat.watchdog import OutputsSent
from drivers.found_settings.settings_file import WRITTEN_ONCE
from drivers.remote_dictionary import NoAnswer
from drivers.session.connection import Connection, places_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.drives_file import DrivesFile
    from drivers.ethercat.line import Line
    from drivers.sync_clock import SyncClock

START_TIME = 3.0
"""How long drives may take from SAFEOP to OP, outputs coming all the while [s]."""
OUT_OF_CYCLE = (
    "the drives' clocks do not agree, or frames come out of their cycles (relieve this computer of"
    " other work, use --realtime, or state distributed_clock: false)"
)
SETTLING = 3
"""Cycles with outputs before OP is asked for: some drives want valid outputs first."""


class EthercatConnection(Connection):
    """The services of all drives on one line.

    Parameters
    ----------
    line : Line
        That they are on.
    clock : SyncClock
        Where the time of a cycle comes from.
    file : DrivesFile
        What is stated of them.
    feed_forward : bool
        The drives are to take offsets of velocity and torque.
    """

    silence = "takes no part in the exchange of process data for {} cycles in a row"
    wiring = "the cables and that no other master is on the line"
    doubling = "no SYNC0 passed between frames for {} cycles in a row: " + OUT_OF_CYCLE
    communications: tuple[EthercatCommunication, ...]
    process_data: EthercatProcessData
    life_sign: OutputsSent

    def __init__(
        self,
        line: Line,
        clock: SyncClock,
        file: DrivesFile,
        *,
        feed_forward: bool,
    ) -> None:
        self._line, self._slaves = line, Slaves(line)
        places = places_of(file.axes)
        drives, servers = reached(line, self._slaves, places, file.sdo_timeout)
        self._drives = drives
        self._timeout = file.heartbeat_timeout
        self._clock: ReferenceClock | None = None
        if isinstance(clock, ReferenceClock) and file.distributed_clock:
            self._clock = clock
        self._clocks: Clocks | None = None
        self._looked = -1
        self._data = data = EthercatProcessData(line, file.axes, drives, clock)
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
        super().__init__(servers, found, data, life_sign)
        for drive, server in zip(drives, servers, strict=True):
            drive.emergencies = partial(self.supervision.take_emergency, server.node)
        line.idle = life_sign.beat

    def start(self) -> None:
        """Bring all drives to SAFEOP as they have been set up, and ask for OP."""
        self._set_clocks()
        pairs = zip(self._drives, self.communications, strict=True)
        for number, (drive, found) in enumerate(pairs):
            drive.outputs, drive.inputs = found.outputs, found.inputs
            with heard(drive.label):
                drive.prepare(LOGICAL + APART * number, self._timeout, self._sync0())
        alone = self._line.read_all(reg.AL_STATUS, 2).counter == len(self._drives)
        self._data.wire(self._clocks, alone=alone)
        self._keep_held()
        ends = self._data.now() + (2 * AHEAD if self._clocks else 0.0)
        for _ in range(SETTLING):
            self._data.sync()
        while self._data.now() < ends:  # some drives want to have seen SYNC0 first
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
        self._data.farthest = 0.0
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
                    f"{self._why_irregular()} {START_TIME:g} s after OP was asked for; check"
                    f" {self.wiring}"
                )
            self._data.sync()

    def _why_irregular(self) -> str:
        if self._clocks is None or self._data.unusual:
            return "not all drives take part in the exchange of process data"
        return f"{OUT_OF_CYCLE},"

    def refuse_unwatched(self) -> None:
        """Refuse drives whose watchdog is not as it was set (see `EthercatDrive`)."""
        for drive in self._drives:
            with heard(drive.label):
                drive.refuse_unwatched()

    def look_at_limits(self) -> None:
        """Read back one object of each drive, the next one at each call: no frame tells of it."""
        self._looked += 1
        for server in self.servers:
            held = [entry for entry in server.kept if entry.index in WRITTEN_ONCE]
            if not held:
                continue
            entry = held[self._looked % len(held)]
            if (present := server.get(entry)) != server.kept[entry]:
                raise Tripped(
                    f"{server.label}: {entry} is {present}, {server.kept[entry]} was written:"
                    " somebody else changed it; nobody else may command these drives: end that"
                    " master or tool first"
                )

    def collect_late(self) -> None:
        """Do nothing: a frame that is late is known by its number and dropped."""

    def close(self) -> None:
        """Put back watchdogs and AL states of drives that are shown to be in PREOP."""
        self._line.idle = lambda: None
        for drive in self._drives:
            try:
                drive.hand_back()
            except (DriveError, NoAnswer):
                continue  # it keeps its watchdog

    def remarks(self) -> Sequence[str]:
        """State how the clocks went, where drives follow one."""
        clock, clocks = self._clock, self._clocks
        if clock is None or clocks is None:
            return ()
        faster = "faster" if clock.skew > 0 else "slower"
        return (
            f"distributed clock: slave {clocks.reference.position} is the reference,"
            f" {1e6 * abs(clock.skew):.1f} ppm {faster} than this computer; {len(clocks.clocked)}"
            f" clocks agree within {1e9 * self._data.farthest:.0f} ns, the last one"
            f" {clocks.delay} ns of cable behind it; SYNC0 comes {1e3 * clock.shift:g} ms after"
            " frames are due",
        )

    def _set_clocks(self) -> None:
        """Have the clocks on the line agree, where every drive has one that it can follow."""
        if self._clock is None:
            return
        with heard("the clocks of the slaves"):
            clocks = Clocks(self._line, self._slaves.all)
            clocked = all(drive.station in clocks.clocked for drive in self._drives)
            clocked = clocked and all(map(offers_sync0, self.servers))
            if clocked:
                self._clocks = clocks
                self._clock.begin(*clocks.settle(self._clock.host))
        for server in self.servers:
            synchronise(server, clocked=clocked)

    def _sync0(self) -> tuple[int, int] | None:
        """Return the next SYNC0 that a drive can be set to, and its cycle [ns]."""
        if self._clock is None or self._clocks is None:
            return None
        return self._clock.first_sync0(self._clocks.now())

    def _keep_held(self) -> None:
        """Have outputs that are mapped beside ours go on to be what the drives hold."""
        for drive, found in zip(self._drives, self.communications, strict=True):
            for entry, value in found.beside:
                drive.carry(entry.index, entry.subindex, entry.data(value))

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
