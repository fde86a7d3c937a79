"""Drive on the line: a slave with CoE, its process data and the watchdog that supervises us.

The drive is brought to PREOP through INIT before the first access to its objects, so that mailboxes
start anew after use by other masters. A watchdog of the sync manager takes the drive out of OP
without outputs, as when this process dies. It is set before OP and read back before power-on; its
original value is restored only when the drive is in PREOP again, where outputs have no effect.
"""

from __future__ import annotations

import struct
import time
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveRefused, NodeSilent
from drivers.ethercat import registers as reg
from drivers.ethercat.eeprom import Layout, read_layout
from drivers.ethercat.mailbox import Mailbox, SdoClient, emergency_of
from drivers.ethercat.pdo_set_up import Mapped
from drivers.ethercat.registers import AlState
from drivers.remote_dictionary import AccessRefused, NoAnswer, RemoteDictionary, axis_suffix

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from drivers.ethercat.line import Line
    from drivers.ethercat.slaves import Slaves, Station
    from drivers.session.connection import Place

DIVIDER = 2498
"""Divider of the watchdog for a unit of 0.1 ms: the default of controllers."""
UNIT = reg.TICK * (DIVIDER + 2)
WATCHDOG_MOST = 0xFFFF * UNIT
"""Longest time of the watchdog [s]."""
_WATCHED = 0x40
"""Control bit of a sync manager: writing feeds the watchdog."""
_READ, _WRITTEN = 1, 2
"""Direction of an FMMU: inputs, outputs."""
_SYNC0 = b"\0\3"
"""Activation (0980h) of cyclic operation and SYNC0, under control of the master."""
_FMMU = struct.Struct("<IHBBHBBB3x")
_MANAGER = struct.Struct("<HHBBBB")
GUARDS = (
    (reg.WATCHDOG_DIVIDER, 2),
    (reg.WATCHDOG_TIME, 2),
    (reg.MANAGER + 2 * reg.MANAGER_SIZE + 4, 1),
)
"""Registers of the watchdog, and their sizes: divider, time, control of outputs."""
ORDER_TIME = 0.02
"""Longest wait of `order` with a full mailbox [s]: other drives must be commanded too."""


class EthercatDrive:
    """EtherCAT drive, and the `Access` to its objects (`drivers.remote_dictionary`).

    Parameters
    ----------
    find : callable
        Returns the slave; called at the first access.
    line : Line
        Line of the drive.
    label : str
        Name of the drive in messages.
    timeout : float
        Longest response time of the mailbox [s].

    Attributes
    ----------
    label : str
    emergencies : callable
        ``emergencies(data)`` receives each emergency.
    outputs, inputs : Mapped
        Content of the process data, once set up.
    carry : callable
        ``carry(index, subindex, data)`` puts a written value into the process data; returns False
        if they do not contain the object.
    """

    def __init__(self, find: Callable[[], Station], line: Line, label: str, timeout: float) -> None:
        self.label = label
        self.emergencies: Callable[[bytes], None] = lambda _: None
        self.carry: Callable[[int, int, bytes], bool] = lambda *_: False
        self.outputs = self.inputs = Mapped((), ())
        self._find, self._line, self._timeout = find, line, timeout
        self._station: Station | None = None
        self._mailbox: Mailbox | None = None
        self._layout: Layout | None = None
        self._sdo: SdoClient | None = None
        self._held: tuple[bytes, bytes] | None = None
        self._state_found = AlState.PREOP
        self._watchdog, self._clocked = b"", False

    @property
    def station(self) -> Station:
        """The slave.

        Raises
        ------
        NoAnswer
            The slave is not there.
        """
        if self._station is None:
            self._station = self._find()
        return self._station

    @property
    def sdo(self) -> SdoClient:
        """SDO client; brings the drive to PREOP at the first access.

        Raises
        ------
        NoAnswer, DriveRefused, BusUnavailable
            The drive is not there, or does not reach PREOP.
        """
        if self._sdo is None:
            self.bring_up()
        assert self._sdo is not None  # noqa: S101 - `bring_up` sets it
        return self._sdo

    def collect(self) -> None:
        """Receive emergencies from the mailbox."""
        if self._mailbox is not None:
            self._mailbox.collect()

    def read(self, index: int, subindex: int, size: int | None = None) -> bytes:
        """Read an object (see `drivers.remote_dictionary.Access`)."""
        return self.sdo.upload(index, subindex, size)

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object, also in the process data if mapped there.

        Some drives refuse an object that is mapped to process data.
        """
        carried = self.carry(index, subindex, data)
        try:
            self.sdo.download(index, subindex, data)
        except AccessRefused:
            if not carried:
                raise

    def order(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object without waiting for an answer."""
        self.sdo.order(index, subindex, data, time.monotonic() + ORDER_TIME)

    def leave_operational(self) -> None:
        """Bring the drive to PREOP."""
        with name_drive(self.label):
            if self._sdo is None:
                self.bring_up()
            elif self.station.state != AlState.PREOP:
                self.station.go(AlState.PREOP)

    def go_operational(self) -> None:
        """Request OP, which the drive reaches with the first outputs."""
        with name_drive(self.label):
            self.station.ask_for(AlState.OP)

    def prepare(self, logical: int, timeout: float, sync0: tuple[int, int] | None = None) -> None:
        """Bring the drive to SAFEOP, with process data, watchdog and SYNC0 configured.

        Parameters
        ----------
        logical : int
            Logical address of the outputs; inputs and mailbox state follow.
        timeout : float
            Watchdog time [s].
        sync0 : (int, int), optional
            First SYNC0 in the reference's time, and its cycle [ns].

        Raises
        ------
        DriveRefused, NoAnswer, BusUnavailable
            The drive refuses, with the AL status code.
        """
        station, layout = self.station, self._layout
        assert layout is not None  # noqa: S101 - the objects were set up before
        outputs, inputs = layout.outputs, layout.inputs
        sizes = self.outputs.size, self.inputs.size
        station.write(reg.MANAGER + 2 * reg.MANAGER_SIZE, bytes(2 * reg.MANAGER_SIZE))
        if self._held is None:
            self._held = station.read(reg.WATCHDOG_DIVIDER, 2), station.read(reg.WATCHDOG_TIME, 2)
        self._watchdog = round(min(timeout, WATCHDOG_MOST) / UNIT).to_bytes(2, "little")
        self.set_watchdog()
        for number, area, size, watched in (
            (2, outputs, sizes[0], _WATCHED),
            (3, inputs, sizes[1], 0),
        ):
            control = (area.control or (0x24 if watched else 0x20)) | watched
            manager = _MANAGER.pack(area.start, size, control, 0, 1, 0)
            station.write(reg.MANAGER + number * reg.MANAGER_SIZE, manager)
        mailbox = reg.MANAGER + reg.MANAGER_SIZE + reg.MANAGER_STATUS
        for number, (start, size, physical, kind) in enumerate((
            (logical, sizes[0], outputs.start, _WRITTEN),
            (logical + sizes[0], sizes[1], inputs.start, _READ),
            (logical + sizes[0] + sizes[1], 1, mailbox, _READ),
        )):  # fmt: skip
            fmmu = _FMMU.pack(start, size, 0, 7, physical, 0, kind, 1)
            station.write(reg.FMMU + number * reg.FMMU_SIZE, fmmu)
        if sync0 is not None:
            self._clocked = True
            station.write(reg.ACTIVATION, bytes(2))
            station.write(reg.SYNC0_START, sync0[0].to_bytes(8, "little"))
            station.write(reg.SYNC0_CYCLE, sync0[1].to_bytes(4, "little"))
            station.write(reg.ACTIVATION, _SYNC0)
        station.go(AlState.SAFEOP)

    def set_watchdog(self) -> None:
        """Write the watchdog time chosen by `prepare` (errors as in `Station`)."""
        self.station.write(reg.WATCHDOG_DIVIDER, DIVIDER.to_bytes(2, "little"))
        self.station.write(reg.WATCHDOG_TIME, self._watchdog)

    def refuse_unwatched(self) -> None:
        """Refuse a drive whose watchdog was changed.

        Raises
        ------
        DriveRefused
            Another master may be at work.
        """
        unwatched = self.why_unwatched([self.station.read(*each) for each in GUARDS])
        if unwatched:
            raise DriveRefused(
                f"{unwatched}; if another master changed the watchdog, stop that master; otherwise"
                " use another drive or firmware"
            )

    def why_unwatched(self, found: Sequence[bytes]) -> str:
        """Describe the difference of registers (`GUARDS`) to the written values; empty if none."""
        divider, limit, control = map(_word, found)
        if found[0] != DIVIDER.to_bytes(2, "little") or found[1] != self._watchdog:
            shown = reg.TICK * (divider + 2) * limit
            return (
                f"{self.label}: the watchdog of its sync manager (0400h, 0420h) is {shown:g} s,"
                f" {UNIT * _word(self._watchdog):g} s was written"
            )
        if not control & _WATCHED:
            return (
                f"{self.label}: its sync manager of outputs has no watchdog (0814h = "
                f"{control:02X}h): the axis would keep moving after a crash of this program"
            )
        return ""

    def hand_back(self) -> None:
        """Restore watchdog and original AL state, and stop SYNC0, in PREOP only.

        In any other state the drive may be energised, and the watchdog is kept.
        """
        if self._station is None or self._sdo is None or self._station.status != AlState.PREOP:
            return
        if self._held is not None:
            self._station.write(reg.WATCHDOG_DIVIDER, self._held[0])
            self._station.write(reg.WATCHDOG_TIME, self._held[1])
            self._held = None
        if self._clocked:
            self._station.write(reg.ACTIVATION, bytes(2))
            self._clocked = False
        if self._state_found == AlState.INIT:
            self._station.go(AlState.INIT)
            self._sdo = self._mailbox = None

    def bring_up(self) -> None:
        """Bring the drive to PREOP through INIT (errors as in `sdo`)."""
        station = self.station
        found = station.state
        station.go(AlState.INIT)
        if self._layout is None:
            self._state_found = AlState.INIT if found == AlState.INIT else AlState.PREOP
            self._layout = read_layout(station)
        out, back = self._layout.mailbox_out, self._layout.mailbox_in
        managers = b"".join(
            _MANAGER.pack(area.start, area.size, area.control, 0, 1, 0) for area in (out, back)
        )
        station.write(reg.MANAGER, managers.ljust(4 * reg.MANAGER_SIZE, b"\0"))
        station.write(reg.FMMU, bytes(3 * reg.FMMU_SIZE))
        station.go(AlState.PREOP)
        self._mailbox = Mailbox(station, out, back, self._take_service)
        self._sdo = SdoClient(self._mailbox, self._timeout)

    def _take_service(self, service: bytes) -> None:
        emergency = emergency_of(service)
        if emergency is not None:
            self.emergencies(emergency)


def _word(data: bytes) -> int:
    return int.from_bytes(data, "little")


@contextmanager
def name_drive(label: str) -> Iterator[None]:
    """Convert a missing answer to an error that names the drive."""
    try:
        yield
    except NoAnswer as error:
        raise NodeSilent(f"{label}: does not answer ({error}); check {error.where}") from error


def make_drives(
    line: Line, slaves: Slaves, places: Sequence[Place], timeout: float
) -> tuple[tuple[EthercatDrive, ...], tuple[RemoteDictionary, ...]]:
    """Return drives and their objects; the slaves are searched at the first access."""
    drives = tuple(
        EthercatDrive(partial(slaves.find, node, alias), line, f"{name} (node {node})", timeout)
        for node, name, alias, _ in places
    )
    for at in places:
        if at.within.axis > 1:
            raise DriveRefused(
                f"{at.name} (node {at.node}{axis_suffix(at.within.axis)}): several axes in a "
                "drive need CAN; use its CAN interface, or drives of one axis each"
            )
    pairs = zip(drives, places, strict=True)
    return drives, tuple(RemoteDictionary(drive, at.node, at.name) for drive, at in pairs)
