"""Bus without CAN: the plant's drives reached by calls, as by another fieldbus.

The module implements all interfaces that a further bus package beside `drivers.canopen` needs:
access to objects, process data, sign of life, communication, connection and bus. No frame is made.
"""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Any

from drivers.cia402 import objects
from drivers.cia402.set_point import ENABLED
from drivers.commissioning.requirements import REQUIREMENTS
from drivers.remote_dictionary import AccessRefused, NoAnswer, RemoteDictionary
from drivers.session.connection import Connection
from sim_plant.canopen.abort_codes import SdoAbort

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from drivers.drive_bus import DriveError
    from drivers.drives_file import AxisDrive, DrivesFile
    from drivers.fieldbus import Entry
    from sim_plant.slave_network import SlaveNetwork


class DirectAccess:
    """Objects of one drive."""

    def __init__(self, drive: Any) -> None:
        self._drive = drive
        self.unplugged = False

    def _asked(self, access: Callable[[], Any]) -> Any:
        if self.unplugged:
            raise NoAnswer("unplugged", "its plug")
        try:
            return access()
        except SdoAbort as abort:
            raise AccessRefused(abort.code, abort.code.name) from abort

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        del size
        return bytes(self._asked(lambda: self._drive.dictionary.upload(index, subindex)))

    def write(self, index: int, subindex: int, data: bytes) -> None:
        self._asked(lambda: self._drive.dictionary.download(index, subindex, data))

    order = write

    def go_operational(self) -> None:
        """Do nothing: drives exchange process data at all times here."""

    leave_operational = go_operational


class DirectProcessData:
    """Statusword, position and current of all axes, read after each period."""

    looks_ahead = False

    def __init__(self, network: SlaveNetwork, axes: tuple[AxisDrive, ...], period: float) -> None:
        self._network, self._axes, self._period = network, axes, period
        self.time, self.skipped = 0.0, 0
        self.irregular = self.untimed = False
        self.flags = (0,) * len(axes)
        self.on_arrival = tuple(range(len(axes)))
        self._latch()

    def _latch(self) -> None:
        drives = [node.dictionary for node in self._network.nodes]
        self.words = tuple(drive.get(0x6041) for drive in drives)
        self.positions = tuple(drive.get(0x6064) for drive in drives)
        measured = [(axis.current.index, axis.current.subindex) for axis in self._axes]
        self.currents = tuple(d.get(*at) for d, at in zip(drives, measured, strict=True))

    def now(self) -> float:
        return self.time

    def command(self, axis: int, target: int, controlword: int) -> None:
        dictionary = self._network.nodes[axis].dictionary
        dictionary.download(0x607A, 0, struct.pack("<i", target))
        dictionary.download(0x6040, 0, struct.pack("<H", controlword))

    def lead(self, axis: int, target: int) -> None:
        self.command(axis, target, ENABLED)

    def feed_forward(self, axis: int, velocity: int, torque: int) -> None:
        raise NotImplementedError

    def withdraw(self, axis: int) -> None:
        """Do nothing: there is no feed-forward here."""

    def speeds(self) -> list[float]:
        return [math.inf] * len(self._axes)

    def sync(self) -> float:
        self.tick()
        self._latch()
        return self.time

    def sync_ahead(self, times: int) -> None:
        del times
        self.sync()

    def tick(self) -> None:
        self._network.elapse(self._period)
        self.time += self._period

    miss = tick

    def hurry(self, hurried: bool) -> None:
        """Do nothing: there are no waits here."""


class DirectLife:
    """Watchdog without time-out."""

    name, timeout, due = "the watchdog's food", 0.5, math.inf
    trouble: DriveError | None = None
    ceased = False

    def watch(self) -> None:
        self.ceased = False

    def service(self) -> None:
        """Do nothing: all drives are present."""

    beat = service

    def cease(self) -> None:
        self.ceased = True


class DirectCommunication:
    """Communication without any set-up."""

    requirements, later, feed_forward = REQUIREMENTS, (), False

    def refusable(self, axis: AxisDrive) -> None:
        """Return no alternatives."""

    def set_up(self, *_: object) -> None:
        """Do nothing."""

    set_up_process_data = set_up


class DirectRules:
    """Rules of a bus without objects of its own."""

    requirements, asked, mappings = REQUIREMENTS, (), ()
    late: frozenset[int] = frozenset()
    watchdogs: frozenset[int] = frozenset()

    @staticmethod
    def restore_process_data(
        _: RemoteDictionary, values: Mapping[Entry, int]
    ) -> tuple[dict[Entry, int], dict[Entry, str]]:
        return dict(values), {}


class DirectConnection(Connection):
    silence = "no answer for {} cycles in a row"
    wiring = "plugs"
    doubling = "two answers came for each of {} cycles in a row"

    def __init__(self, network: SlaveNetwork, drives: DrivesFile, period: float) -> None:
        servers = tuple(
            RemoteDictionary(DirectAccess(node), axis.node, axis.name)
            for node, axis in zip(network.nodes, drives.axes, strict=True)
        )
        super().__init__(
            servers,
            tuple(DirectCommunication() for _ in servers),
            DirectProcessData(network, drives.axes, period),
            DirectLife(),
        )

    def conflicts(self) -> tuple[()]:
        return ()

    def start(self) -> None:
        self.life_sign.watch()

    def await_answers(self) -> None:
        self.cycle()

    def collect_late(self) -> None:
        """Do nothing: no telegram is late."""

    def close(self) -> None:
        """Do nothing: the bus holds no state."""


class DirectBus:
    """Subset of `drivers.session.connection.Fieldbus` needed by sessions."""

    rules = DirectRules()
    recorded, lock_step, keeps_time = False, True, False

    def __init__(self, network: SlaveNetwork) -> None:
        self.network = network
        self.network.power_on()
        self.closed = False
        self.connection: DirectConnection | None = None

    def connect(
        self, drives: DrivesFile, period: float, *, feed_forward: bool = False
    ) -> DirectConnection:
        assert not feed_forward
        self.connection = DirectConnection(self.network, drives, period)
        return self.connection

    def shutdown(self) -> None:
        self.closed = True


def word_of(bus: DirectBus, axis: int) -> int:
    """Return the statusword of a drive."""
    return bus.network.nodes[axis].dictionary.get(objects.STATUSWORD.index)
