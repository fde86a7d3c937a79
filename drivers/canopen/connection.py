"""Services of CANopen drives, built completely or not at all.

Nothing is sent during building. If a part cannot be built, the parts already on the bus are
removed; the bus itself belongs to the caller.

A drive may take some time from NMT start to OPERATIONAL, or miss the command: the command is
repeated until the drive answers SYNC, which only an operational one does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.canopen.communication import CanopenCommunication, find_collisions
from drivers.canopen.heartbeat import START_TIME, ForeignFrames, Heartbeats, guarding_request
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.pdo_mapping import answers
from drivers.canopen.process_data import SyncProcessData
from drivers.canopen.rules import WATCHDOGS
from drivers.canopen.sdo import server_of
from drivers.canopen.sync_clock import KernelClock, choose_sync_clock, kernel_sync
from drivers.drive_bus import DriveRefused, NodeSilent
from drivers.remote_dictionary import labels_by_node
from drivers.session.connection import Connection, places_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    import can

    from drivers.can_bus.kernel_sync import KernelSync
    from drivers.drives_file import DrivesFile
    from drivers.fieldbus import PacingName
    from drivers.sync_clock import SyncClock

START_AGAIN = 0.1
"""Time until NMT start is repeated for a drive that does not answer SYNC [s]."""


class CanopenConnection(Connection):
    """Services of the drives on a bus.

    Parameters
    ----------
    channel : can.BusABC
        An open bus, or the bus in front of it if the kernel sends SYNC (`kernel`).
    clock : SyncClock
        Source of SYNC's time.
    drives : DrivesFile
        Axes in joint order.
    feed_forward : bool
        True if the drives take offsets of velocity and torque.
    kernel : KernelSync, optional
        Bus on which the kernel sends SYNC.
    """

    silence = "no TPDO for {} SYNCs in a row"
    wiring = "CAN wiring and termination"
    doubling = (
        "two telegrams for each of {} SYNCs in a row; give each node its own number, and stop "
        "other producers of SYNC"
    )
    guards = WATCHDOGS
    communications: tuple[CanopenCommunication, ...]
    process_data: SyncProcessData
    life_sign: Heartbeats

    def __init__(
        self,
        channel: can.BusABC,
        clock: SyncClock,
        drives: DrivesFile,
        *,
        feed_forward: bool,
        kernel: KernelSync | None = None,
    ) -> None:
        self._network = network = PumpedNetwork(channel, synchronous=clock.synchronous)
        self._kernel, self._clock, self._master = kernel, clock, drives.master_node
        if kernel is not None:
            kernel.deliver = network.dispatch
        servers = tuple(server_of(network, at, drives.sdo_timeout) for at in places_of(drives.axes))
        communications = tuple(
            CanopenCommunication.predefined(axis, feed_forward=feed_forward) for axis in drives.axes
        )
        labels = labels_by_node(servers)
        heartbeats = Heartbeats(
            network,
            drives.master_node,
            labels,
            drives.heartbeat_period,
            drives.heartbeat_timeout,
            clock.now,
        )
        data = SyncProcessData(network, drives.axes, clock, communications)
        super().__init__(servers, communications, data, heartbeats)
        network.idle = heartbeats.beat
        self._nodes, self._emergencies = list(labels), dict[int, int]()
        self._listen_to_emergencies([0x80 + node for node in labels])
        self._foreign = ForeignFrames(network, labels, heartbeats.fail, self._watch_again)

    @classmethod
    def open(
        cls,
        bus: can.BusABC,
        drives: DrivesFile,
        period: float,
        pacing: PacingName,
        *,
        feed_forward: bool = False,
    ) -> CanopenConnection:
        """Build all services on an open bus, or none.

        Parameters
        ----------
        bus : can.BusABC
        drives, period, feed_forward
            See `drivers.session.connection.Fieldbus.connect`.
        pacing : {"auto", "lock-step", "wall-clock"}
            See `drivers.canopen.sync_clock.choose_sync_clock`.
        """
        expected = [cob_id for axis in drives.axes for cob_id in answers(axis)]
        kernel = kernel_sync(bus, pacing, period, expected)
        if kernel is None:
            clock = choose_sync_clock(bus, pacing, period)
            return cls(bus, clock, drives, feed_forward=feed_forward)
        try:
            paced = KernelClock(kernel, period)
            return cls(kernel, paced, drives, feed_forward=feed_forward, kernel=kernel)
        except BaseException:
            kernel.shutdown()
            raise

    def remarks(self) -> Sequence[str]:
        """Return remarks on other participants heard on the bus."""
        return self._foreign.remarks

    def conflicts(self) -> Sequence[DriveRefused]:
        """Return an error for each drive that uses an identifier already in use."""
        return find_collisions(self.communications, self._master)

    def start(self) -> None:
        """Expect the frames of each drive as set up, and start every drive (NMT)."""
        found = self.communications
        self.process_data.wire(found)
        ours = {pdo.cob_id: drive.node for drive in found for pdo in drive.inputs if pdo}
        self._foreign.wire(ours, [pdo.cob_id for drive in found for pdo in drive.transmitted])
        nodes = {drive.node: drive for drive in found}
        self._listen_to_emergencies([drive.emergency for drive in nodes.values()])
        self.life_sign.requests = [
            guarding_request(n) for n, drive in nodes.items() if drive.guarded
        ]
        for server in self.servers:
            server.access.go_operational()

    def _listen_to_emergencies(self, identifiers: Sequence[int | None]) -> None:
        """Receive emergencies with these identifiers (1014); None marks disabled ones."""
        for identifier in self._emergencies:
            self._network.unsubscribe(identifier, self._take_emergency)
        pairs = zip(identifiers, self._nodes, strict=True)
        self._emergencies = {number: node for number, node in pairs if number is not None}
        for identifier in self._emergencies:
            self._network.subscribe(identifier, self._take_emergency)

    def _take_emergency(self, can_id: int, data: bytearray, timestamp: float) -> None:
        del timestamp
        self.supervision.take_emergency(self._emergencies[can_id], bytes(data))

    def await_answers(self) -> None:
        """Wait until each drive answers SYNC, after the command to start (see `Connection`)."""
        clock, data, heartbeats = self._clock, self.process_data, self.life_sign
        heartbeats.watch(starting=True)
        heartbeats.hurry()  # a drive starts supervision with the first heartbeat
        self.supervision.forget()
        begun = clock.now()
        again = begun + START_AGAIN
        self.cycle()
        while data.irregular:
            pairs = zip(self.servers, data.flags, strict=True)
            silent = [server for server, flag in pairs if flag]
            if clock.now() > begun + START_TIME:
                labels = "; ".join(server.label for server in silent)
                if all(server.node in heartbeats.starting for server in silent):
                    raise NodeSilent(
                        f"{labels}: not operational {START_TIME:g} s after NMT start, which was"
                        " repeated; check the drive's supply and state, and that no other master"
                        " is on the bus"
                    )
                raise NodeSilent(
                    f"{labels}: does not answer each SYNC with one TPDO of the mapped length; check"
                    " that no other master is on the bus, and the bus load"
                )
            if clock.now() > again:
                for server in silent:
                    server.access.go_operational()
                again = clock.now() + START_AGAIN
            self.cycle()

    def _watch_again(self, node: int) -> None:
        """Restore a powered drive's supervision of our life sign as set at start-up."""
        if self.life_sign.trouble is None:
            return
        for server in self.servers:
            for entry in server.held(self.guards) if server.node == node else ():
                server.order(entry, server.kept[entry])
        self.life_sign.hurry()

    def collect_late(self) -> None:
        """Receive late telegrams, which arrive with our heartbeat."""
        self.life_sign.hurry()
        self._network.pump(0.0)

    def close(self) -> None:
        """Remove the kernel's SYNC from the bus, which stays open."""
        if self._kernel is not None:
            self._kernel.shutdown()
