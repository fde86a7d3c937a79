"""What connecting builds: all that is needed to talk to the drives, complete or absent.

Nothing is sent while it is built. Where a part cannot be built, what stands on the bus already is
taken away again and nothing is left; the bus itself belongs to the caller.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from drivers.canopen.communication import Communication
from drivers.canopen.emergency import Emergencies
from drivers.canopen.heartbeat import Heartbeats
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.pdo_mapping import answers
from drivers.canopen.process_data import SyncProcessData
from drivers.canopen.sdo import RemoteDictionary
from drivers.canopen.sync_clock import KernelClock, choose_sync_clock, kernel_sync
from drivers.cia402.power import Power
from drivers.cia402.supervision import Supervision

if TYPE_CHECKING:
    from typing import Self

    import can

    from drivers.can_bus.kernel_sync import KernelSync
    from drivers.canopen.sync_clock import PacingName, SyncClock
    from drivers.drives_file import DrivesFile


@dataclass(frozen=True, eq=False)
class Connection:
    """The services of all drives on one bus, in joint order.

    Attributes
    ----------
    kernel : KernelSync or None
        What stands on the bus where the kernel sends SYNC.
    clock : SyncClock
        Where SYNC's time comes from.
    network : PumpedNetwork
        Receives, and keeps our heartbeat going meanwhile.
    servers : tuple of RemoteDictionary
        The drives' object dictionaries.
    communications : tuple of Communication
        Identifiers and PDOs of each; what is found is put in.
    supervision : Supervision
        Judges statuswords and emergencies.
    emergencies : Emergencies
        Where these come from.
    process_data : SyncProcessData
        Of all axes.
    heartbeats : Heartbeats
        Ours and theirs.
    power : Power
        Switches drives on and off.
    written : list of RemoteDictionary
        Drives to which something may have been written; grows.
    """

    kernel: KernelSync | None
    clock: SyncClock
    network: PumpedNetwork
    servers: tuple[RemoteDictionary, ...]
    communications: tuple[Communication, ...]
    supervision: Supervision
    emergencies: Emergencies
    process_data: SyncProcessData
    heartbeats: Heartbeats
    power: Power
    written: list[RemoteDictionary] = field(default_factory=list)

    @classmethod
    def on(
        cls,
        bus: can.BusABC,
        drives: DrivesFile,
        period: float,
        pacing: PacingName,
        *,
        feed_forward: bool = False,
    ) -> Self:
        """Build everything on an open bus, or nothing.

        Parameters
        ----------
        bus : can.BusABC
        drives : DrivesFile
            The axes in joint order.
        period : float
            Time between two SYNCs [s].
        pacing : {"auto", "lock-step", "wall-clock"}
            See `drivers.canopen.sync_clock.choose_sync_clock`.
        feed_forward : bool
            The drives are to take offsets of velocity and torque.
        """
        expected = [cob_id for axis in drives.axes for cob_id in answers(axis)]
        kernel = kernel_sync(bus, pacing, period, expected)
        if kernel is None:
            clock = choose_sync_clock(bus, pacing, period)
            return cls._through(bus, None, clock, drives, feed_forward=feed_forward)
        try:
            paced = KernelClock(kernel, period)
            return cls._through(kernel, kernel, paced, drives, feed_forward=feed_forward)
        except BaseException:
            kernel.shutdown()
            raise

    @classmethod
    def _through(
        cls,
        channel: can.BusABC,
        kernel: KernelSync | None,
        clock: SyncClock,
        drives: DrivesFile,
        *,
        feed_forward: bool,
    ) -> Self:
        network = PumpedNetwork(channel, synchronous=clock.synchronous)
        if kernel is not None:
            kernel.deliver = network.dispatch
        servers = tuple(
            RemoteDictionary(network, axis.node, axis.name, drives.sdo_timeout)
            for axis in drives.axes
        )
        supervision = Supervision(servers)
        communications = tuple(
            Communication.predefined(axis, server.label, feed_forward=feed_forward)
            for axis, server in zip(drives.axes, servers, strict=True)
        )
        process_data = SyncProcessData(network, drives.axes, clock, communications)
        heartbeats = Heartbeats(
            network,
            drives.master_node,
            {server.node: server.label for server in servers},
            drives.heartbeat_period,
            drives.heartbeat_timeout,
            clock.now,
        )
        network.idle = heartbeats.beat
        return cls(
            kernel=kernel,
            clock=clock,
            network=network,
            servers=servers,
            communications=communications,
            supervision=supervision,
            emergencies=Emergencies(
                network, [server.node for server in servers], supervision.take_emergency
            ),
            process_data=process_data,
            heartbeats=heartbeats,
            power=Power(process_data, servers, supervision),
        )

    def cycle(self) -> None:
        """Let one SYNC pass.

        Raises
        ------
        NodeSilent, BusUnavailable
            A drive's heartbeat stays away; the bus does not serve any more.
        """
        self.process_data.sync()
        self.heartbeats.service()
        if self.heartbeats.trouble:
            raise self.heartbeats.trouble

    def beating_cycle(self) -> None:
        """Let one SYNC pass, whoever's heartbeat stays away."""
        self.process_data.sync()
        self.heartbeats.beat()

    def collect_late(self) -> None:
        """Take telegrams off the bus that are merely late: with our heartbeat they come."""
        self.heartbeats.hurry()
        self.network.pump(0.0)

    def close(self) -> None:
        """Take away what was put on the bus, which stays open."""
        if self.kernel is not None:
            self.kernel.shutdown()
