"""Servo axes on a CANopen bus: `DriveBus` for CiA 402 drives in profile position mode.

Entering checks and configures every drive while it is off (`commissioning`), starts the exchange of
process data, and only when every drive has passed powers all of them on together (`power`). Then
time passes in `CanopenDriveBus.sample` alone: one SYNC, the TPDOs that it latched (`exchange`),
set-point handshakes, heartbeats, statuswords and emergencies. There is no thread. Trouble stops all
axes before it is raised, and leaving powers everything off, whatever happened.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from drivers.admission import admit
from drivers.cia402 import State
from drivers.communication import Communication
from drivers.drive_bus import AxisInfo, DriveError, DriveFault, MoveFailed, NodeSilent
from drivers.exchange import Exchange
from drivers.frame_log import logged
from drivers.gaps import Gaps
from drivers.heartbeat import Heartbeats
from drivers.interrupts import interrupts_held
from drivers.kernel_sync import KernelSync
from drivers.life_guarding import guarding_request
from drivers.motions import Motions
from drivers.move_check import check_move
from drivers.network import PumpedNetwork
from drivers.open_bus import open_can_bus
from drivers.pacing import choose_pacing, sync_channel
from drivers.path_check import check_path
from drivers.pdo_mapping import answers
from drivers.power import Power
from drivers.readout import Readout
from drivers.scaling import AxisScale
from drivers.sdo import SdoServer
from drivers.streams import Streams
from drivers.supervision import Supervision
from drivers.trips import Trips
from drivers.zero_current import offsets

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

    import can

    from drivers.drive_bus import Move, Sample
    from drivers.drives_file import DrivesFile
    from drivers.pacing import PacingName
    from drivers.pdo_mapping import Pdo

log = logging.getLogger(__name__)


class CanopenDriveBus:
    """CiA 402 drives as a `drivers.drive_bus.DriveBus`.

    On the wall clock the caller must come back to `sample` within the heartbeat timeout of the
    drives file, or the drives take us for dead and stop.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    drives : DrivesFile
        The axes in joint order.
    period : float, optional
        Time between two SYNCs [s]; by default that of the drives file.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.pacing.choose_pacing`.
    reset_faults : bool
        Reset drives that are found in a fault, instead of refusing them.
    owns_bus : bool
        Shut the bus down when leaving.

    Attributes
    ----------
    notes : tuple of str
        What the operator should know though it stops nothing: what drives lack and could be done
        without, their warnings. Grows.
    """

    def __init__(
        self,
        bus: can.BusABC,
        drives: DrivesFile,
        *,
        period: float | None = None,
        pacing: PacingName = "auto",
        reset_faults: bool = False,
        owns_bus: bool = False,
    ) -> None:
        self.notes: tuple[str, ...] = ()
        self._bus = bus
        self._drives = drives
        self._period = drives.sync_period if period is None else period
        self._requested = pacing
        self._reset_faults = reset_faults
        self._owns_bus = owns_bus
        self._axes: tuple[AxisInfo, ...] = ()
        self._scales = [AxisScale.of(axis) for axis in drives.axes]
        self._readout = Readout(drives.axes)

    @property
    def period(self) -> float:
        """Time between two SYNCs [s]."""
        return self._period

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """What the drives told about themselves; known once entered."""
        return self._axes

    @property
    def servers(self) -> tuple[SdoServer, ...]:
        """The drives' object dictionaries in joint order; known once entered."""
        return tuple(self._servers)

    @property
    def transmitted(self) -> tuple[tuple[Pdo, ...], ...]:
        """The TPDOs with which each drive answers SYNC; known once entered."""
        return tuple(drive.transmitted for drive in self._communications)

    @property
    def skipped_syncs(self) -> int:
        """SYNCs left out since the bus was entered, because we came too late for them."""
        return self._pacing.skipped

    def __enter__(self) -> Self:
        """Check, configure and power on every drive (see `drivers.drive_bus.DriveBus`).

        Raises
        ------
        DriveRefused, NodeSilent, DriveFault, BusUnavailable
            Why not; nothing is energised then.
        """
        self._connect()
        try:
            self._admit()
            self._start()
            self._power.walk(State.SWITCHED_ON, self._cycle)
            self._note_offsets("before power-on")
            self._power.walk(State.OPERATION_ENABLED, self._cycle)
            self._pacing.skipped = 0
            self._trips.arm(self._pacing.now(), self._exchange.positions)
        except BaseException as error:
            self._leave(error)
            raise
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop the axes and power off, also after errors and further Ctrl-C.

        Raises
        ------
        DriveFault
            A drive could not be switched off. Where another exception is under way, this is
            added to its notes instead.
        """
        self._leave(exc)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Give set-points to axes and return at once (see `drivers.drive_bus.DriveBus`)."""
        for axis, move in moves.items():
            check_move(move, self._drives.axes[axis], self._scales[axis], axis + 1)
        if self._streams.cyclic:
            self._change_mode(self._streams.leave)
        for axis, move in moves.items():
            moving = axis in self._motions.active
            self._trips.expect(axis, self._exchange.positions[axis], move.target, moving=moving)
        try:
            self._motions.start(moves)
        except DriveError as error:
            self._fail(error)

    def stream(self, path: Sequence[Sequence[float]]) -> None:
        """Begin to send a path of set-points (see `drivers.drive_bus.StreamingBus`)."""
        if self._motions.active or self._streams.moving:
            raise MoveFailed("a path can only begin where all axes rest; wait until reached")
        here = self._readout.sample(self._pacing.now(), self._exchange, reached=True).q
        points = np.asarray(path, dtype=float)
        check_path(points, self._drives.axes, here, self._period)
        self._change_mode(lambda: self._streams.begin(points))

    def sample(self) -> Sample:
        """Return what the axes reported for the next SYNC (see `drivers.drive_bus.DriveBus`)."""
        exchange, motions = self._exchange, self._motions
        time = exchange.sync()
        if time >= self._heartbeats.due:
            self._heartbeats.service()
        words = exchange.words
        if words != self._words or self._supervision.emergency or self._heartbeats.trouble:
            self._attend(words)
        if exchange.irregular or self._gaps.open:
            blind = self._gaps.look(exchange.flags)
            if blind:
                self._fail(blind)
        if motions.active:
            failed = motions.advance(time, words, exchange.positions, exchange.flags)
            if failed:
                self._fail(failed)
        tripped = self._trips.look(time, exchange)
        if tripped:
            self._fail(tripped)
        streams = self._streams
        if streams.cyclic:
            failed = streams.advance()
            if failed:
                self._fail(failed)
        return self._readout.sample(time, exchange, not (motions.active or streams.moving))

    def follow(self) -> Sample:
        """Return the next sample while a drive moves by itself, as in homing.

        Statuswords, emergencies and heartbeats are watched as in `sample`; where the axes go is
        not, since only the drive knows.
        """
        time = self._exchange.sync()
        self._heartbeats.service()
        self._attend(self._exchange.words)
        self._trips.arm(time, self._exchange.positions)
        return self._readout.sample(time, self._exchange, reached=False)

    def halt(self) -> None:
        """Bring every axis to rest with its profile deceleration; the drives stay powered."""
        self._streams.abandon()
        self._motions.halt()

    def _connect(self) -> None:
        drives = self._drives
        expected = [cob_id for axis in drives.axes for cob_id in answers(axis)]
        self._channel = sync_channel(self._bus, self._requested, self._period, expected)
        self._pacing = choose_pacing(self._channel, self._requested, self._period)
        network = PumpedNetwork(self._channel, synchronous=self._pacing.synchronous)
        if isinstance(self._channel, KernelSync):
            self._channel.deliver = network.dispatch
        self._servers = [
            SdoServer(network, axis.node, axis.name, drives.sdo_timeout) for axis in drives.axes
        ]
        self._communications = [
            Communication.predefined(axis, server.label)
            for axis, server in zip(drives.axes, self._servers, strict=True)
        ]
        self._supervision = Supervision(network, self._servers)
        self._exchange = Exchange(network, drives.axes, self._pacing)
        now = self._pacing.now
        self._heartbeats = Heartbeats(
            network,
            drives.master_node,
            {server.node: server.label for server in self._servers},
            drives.heartbeat_period,
            drives.heartbeat_timeout,
            now,
        )
        network.idle = self._heartbeats.beat
        bands = [
            axis.position_window / abs(scale.position)
            for axis, scale in zip(drives.axes, self._scales, strict=True)
        ]
        self._power = Power(
            self._exchange, self._servers, self._supervision, self._heartbeats, now, bands
        )
        self._commissioned: list[SdoServer] = []
        self._running = False
        self._motions = Motions(self._exchange, self._servers, drives.axes, self._period, now)
        self._trips = Trips(drives.axes, self._period)
        self._streams = Streams(
            self._exchange, self._servers, drives.axes, self._trips, self._period, self.follow
        )
        self._gaps = Gaps(network, self._servers, self._heartbeats)
        self._words: tuple[int, ...] = ()

    def _admit(self) -> None:
        self._axes = admit(
            self._servers,
            self._drives,
            self._period,
            self._power,
            self._commissioned,
            self._communications,
            reset_faults=self._reset_faults,
        )
        self._exchange.wire(self.transmitted)
        self._supervision.listen([drive.emergency for drive in self._communications])
        self._heartbeats.requests = [
            guarding_request(drive.node) for drive in self._communications if drive.guarded
        ]
        self._note(note for server in self._servers for note in server.notes)

    def _start(self) -> None:
        for server in self._servers:
            server.enter_operational()
        self._running = True
        self._heartbeats.watch()
        self._supervision.forget()
        ends = self._pacing.now() + 1.0
        self._cycle()
        while self._exchange.irregular:
            if self._pacing.now() > ends:
                silent = [
                    server.label
                    for server, flag in zip(self._servers, self._exchange.flags, strict=True)
                    if flag
                ]
                raise NodeSilent(
                    f"{'; '.join(silent)}: does not answer each SYNC with one TPDO of the mapped "
                    "length; check that no other master is on the bus, and the bus load"
                )
            self._cycle()

    def _cycle(self) -> None:
        self._exchange.sync()
        self._heartbeats.service()
        if self._heartbeats.trouble:
            raise self._heartbeats.trouble

    def _attend(self, words: tuple[int, ...]) -> None:
        self._words = words
        self._readout.note_limits(words)
        if self._heartbeats.trouble:
            self._fail(self._heartbeats.trouble)
        lost = self._supervision.lost(words)
        if lost is not None:
            self._stop()  # first of all: the drive may have to be asked for the reason
            raise self._supervision.diagnose(self._servers[lost], words[lost])
        self._note(self._supervision.warnings())

    def _change_mode(self, change: Callable[[], None]) -> None:
        try:
            change()
        except DriveError as error:
            self._fail(error)

    def _fail(self, trouble: DriveError) -> NoReturn:
        self._stop()
        raise trouble

    def _stop(self) -> None:
        self._words = ()
        self._motions.active.clear()
        self._streams.abandon()
        self._power.stop()

    def _note(self, notes: Iterable[str]) -> None:
        new = tuple(notes)
        self.notes += new
        for note in new:
            log.warning("%s", note)

    def _note_offsets(self, when: str) -> None:
        self._note(offsets(self._exchange, self._drives.axes, self._exchange.sync, when))

    def _leave(self, error: BaseException | None) -> None:
        with interrupts_held():
            problems = self._power.power_down(
                self._commissioned,
                running=self._running,
                when_off=lambda: self._note_offsets("after power-off"),
            )
            self._commissioned, self._running = [], False
            if self._channel is not self._bus:
                self._channel.shutdown()
            if self._owns_bus:
                self._bus.shutdown()
            text = "powering off is incomplete, press the emergency stop: " + "; ".join(problems)
            if getattr(self._bus, "recorded", False):
                problems = []
            if problems:
                log.error("%s", text)
                if error is not None:
                    error.add_note(text)
        if problems and error is None:
            raise DriveFault(text)


def open_drive_bus(
    drives: DrivesFile,
    interface: str,
    channel: str,
    bus_options: Mapping[str, object] | None = None,
    pacing: PacingName = "auto",
    frame_log: Path | None = None,
) -> CanopenDriveBus:
    """Open a python-can bus and put a `CanopenDriveBus` on it, which shuts it down when left.

    Parameters
    ----------
    drives : DrivesFile
        The axes in joint order, and the bit rate.
    interface, channel : str
        As python-can names them.
    bus_options : mapping, optional
        Further arguments of the interface.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.pacing.choose_pacing`.
    frame_log : path, optional
        Where to log all frames (see `drivers.frame_log`).

    Raises
    ------
    BusUnavailable
        No such interface or channel, or it cannot be opened, with the remedy.
    FileError
        The log of frames cannot be written.
    """
    options = {"bitrate": drives.bitrate, **(bus_options or {})}
    bus = open_can_bus(interface, channel, options)
    if frame_log is not None:
        bus = logged(bus, frame_log)
    return CanopenDriveBus(bus, drives, pacing=pacing, owns_bus=True)
