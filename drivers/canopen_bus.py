"""Servo axes on a CANopen bus: `DriveBus` for CiA 402 drives in profile position mode.

Entering checks and configures every drive while it is off (`commissioning.check_and_configure`),
starts process data, and only when every drive has passed powers all of them on together
(`cia402.power`). Then time passes in `CanopenDriveBus.sample` alone: one SYNC, the TPDOs that it
latched (`canopen.process_data`), set-point handshakes, heartbeats, statuswords and emergencies.
There is no thread. Trouble stops all axes before it is raised and latches: nothing moves until
`CanopenDriveBus.reset`. Leaving stops and switches everything off (`cia402.shutdown`), whatever
happened, and releases the watchdogs of those drives that have shown that they are off.
"""

from __future__ import annotations

import logging
import math
from contextlib import suppress
from time import monotonic
from typing import TYPE_CHECKING, NoReturn

import numpy as np

from checked_files.yaml_file import FileError
from drivers.axis import AxisScale
from drivers.can_bus.frame_log import logged
from drivers.can_bus.kernel_sync import KernelSync
from drivers.can_bus.opening import open_can_bus
from drivers.canopen.communication import Communication
from drivers.canopen.emergency import Emergencies
from drivers.canopen.heartbeat import Heartbeats
from drivers.canopen.life_guarding import guarding_request
from drivers.canopen.network import PumpedNetwork
from drivers.canopen.pdo_mapping import answers
from drivers.canopen.process_data import SyncProcessData
from drivers.canopen.sdo import RemoteDictionary
from drivers.canopen.sync_clock import choose_sync_clock, sync_channel
from drivers.cia402 import objects
from drivers.cia402.cyclic_position import CyclicPosition
from drivers.cia402.power import Power
from drivers.cia402.profile_position import ProfilePosition
from drivers.cia402.samples import SampleReader
from drivers.cia402.set_point_limits import check_move
from drivers.cia402.shutdown import Shutdown
from drivers.cia402.states import State
from drivers.cia402.stream_limits import check_path
from drivers.cia402.supervision import Supervision
from drivers.commissioning.check_and_configure import check_and_configure
from drivers.commissioning.effective_limits import SLOWEST_STOP
from drivers.drive_bus import (
    AxisInfo,
    DriveError,
    DriveFault,
    DriveRefused,
    LimitExceeded,
    MoveFailed,
    NodeSilent,
    Tripped,
)
from drivers.found_settings.keeping import SettingsKeeper
from drivers.found_settings.restoring import WATCHDOGS
from drivers.interrupts import interrupts_held
from drivers.safety.current_offset import offsets
from drivers.safety.missing_telegrams import MissingTelegrams
from drivers.safety.trips import SPEED_SHARE, Trips

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path
    from types import TracebackType
    from typing import Self

    import can

    from drivers.canopen.pdo_mapping import Pdo
    from drivers.canopen.sync_clock import PacingName
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drive_bus import Move, Sample
    from drivers.drives_file import AxisDrive, DrivesFile

log = logging.getLogger(__name__)

UNSUPERVISED = 0.5
"""Share of the heartbeat timeout for which nobody may look at axes in motion."""


RESTORING = 20.0
"""For how long at most settings are put back on leaving [s]; `hil drives restore` does the rest."""


def _outside() -> DriveError:
    return DriveRefused("the drives are not powered: enter the bus first, in a with statement")


class CanopenDriveBus:
    """CiA 402 drives as a `drivers.drive_bus.DriveBus`.

    On the wall clock the caller must come back to `sample` within the heartbeat timeout of the
    drives file, or the drives take us for dead and stop; within half of it while axes move, or they
    are stopped for want of supervision.

    Parameters
    ----------
    bus : can.BusABC
        An open bus.
    drives : DrivesFile
        The axes in joint order.
    period : float, optional
        Time between two SYNCs [s]; by default that of the drives file.
    pacing : {"auto", "lock-step", "wall-clock"}
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    reset_faults : bool
        Reset drives that are found in a fault, instead of refusing them.
    owns_bus : bool
        Shut the bus down when leaving.
    anywhere : bool
        Power on also where an axis stands outside its limits, as before homing.
    keeper : SettingsKeeper, optional
        Keeps what the drives hold before they are written to; by default in memory only.

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
        anywhere: bool = False,
        keeper: SettingsKeeper | None = None,
    ) -> None:
        self.notes: tuple[str, ...] = ()
        self._bus = bus
        self._drives = drives
        self._period = drives.sync_period if period is None else period
        self._requested = pacing
        self._reset_faults = reset_faults
        self._owns_bus = owns_bus
        self._anywhere = anywhere
        self._keeper = keeper or SettingsKeeper()
        self._axes: tuple[AxisInfo, ...] = ()
        self._limits: tuple[EffectiveLimits, ...] = ()
        self._limited = drives.axes
        self._trip: DriveError | None = _outside()
        self._inside = False
        self._servers: list[RemoteDictionary] = []
        self._words: tuple[int, ...] = ()
        self._scales = [AxisScale.of(axis) for axis in drives.axes]
        self._samples = SampleReader(drives.axes)
        self._channel = bus

    @property
    def period(self) -> float:
        """Time between two SYNCs [s]."""
        return self._period

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """What the drives stated about themselves; available once entered."""
        return self._axes

    @property
    def limits(self) -> tuple[EffectiveLimits, ...]:
        """Which limits hold, the drives' own or the drives file's; available once entered."""
        return self._limits

    @property
    def limited_axes(self) -> tuple[AxisDrive, ...]:
        """What the drives file states of the axes, with the limits that hold; once entered."""
        return self._limited

    @property
    def servers(self) -> tuple[RemoteDictionary, ...]:
        """The drives' object dictionaries in joint order; available once entered."""
        return tuple(self._servers)

    @property
    def transmitted(self) -> tuple[tuple[Pdo, ...], ...]:
        """The TPDOs with which each drive answers SYNC; available once entered."""
        return tuple(drive.transmitted for drive in self._communications)

    @property
    def skipped_syncs(self) -> int:
        """SYNCs left out since the bus was entered, because we came too late for them."""
        return self._clock.skipped

    def __enter__(self) -> Self:
        """Check, configure and power on every drive (see `drivers.drive_bus.DriveBus`).

        Raises
        ------
        DriveRefused, NodeSilent, DriveFault, BusUnavailable
            Why not; nothing is energised then.
        """
        if self._inside:
            raise DriveRefused("the bus has been entered already; leave it first")
        try:
            self._connect()
        except BaseException:
            self._close()
            raise
        self._inside, self._trip = True, None
        try:
            self._check_and_configure()
            self._start()
            self._power_on()
        except BaseException as error:
            self._leave_for_certain(error)
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
        self._leave_for_certain(exc)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Give set-points to axes and return at once (see `drivers.drive_bus.DriveBus`)."""
        self._refuse_after_trip()
        for axis, move in moves.items():
            own = self._limits[axis].own
            check_move(move, self._limited[axis], self._scales[axis], axis + 1, own)
        try:
            if self._cyclic_position.cyclic:
                self._cyclic_position.leave()
            for axis, move in moves.items():
                moving = axis in self._profile_position.active
                self._trips.expect(
                    axis, self._process_data.positions[axis], move.target, moving=moving
                )
            self._profile_position.start(moves)
        except DriveError as error:
            self._fail(error)

    def stream(self, path: Sequence[Sequence[float]]) -> None:
        """Begin to send a path of set-points (see `drivers.drive_bus.StreamingBus`)."""
        self._refuse_after_trip()
        if self._profile_position.active or self._cyclic_position.moving:
            raise MoveFailed("a path can only begin where all axes rest; wait until reached")
        here = self._samples.sample(self._clock.now(), self._process_data, reached=True).q
        points = np.asarray(path, dtype=float)
        own = [limits.own for limits in self._limits]
        check_path(points, self._limited, here, self._period, own)
        try:
            self._cyclic_position.begin(points)
        except DriveError as error:
            self._fail(error)

    def sample(self) -> Sample:
        """Return what the axes reported for the next SYNC (see `drivers.drive_bus.DriveBus`)."""
        if self._trip is not None:
            self._supervise_trip()
        process_data, profile_position, cyclic_position = (
            self._process_data,
            self._profile_position,
            self._cyclic_position,
        )
        before = process_data.time
        try:
            time = process_data.sync()
            if time >= self._heartbeats.due:
                self._heartbeats.service()
            words = process_data.words
            if words != self._words or self._supervision.emergency or self._heartbeats.trouble:
                self._attend(words)
            if process_data.irregular or self._missing.open:
                blind = self._missing.look(process_data.flags)
                if blind:
                    self._fail(blind)
            if time - before > self._unsupervised and (
                profile_position.active or cyclic_position.moving
            ):
                self._fail(self._unattended(time - before))
            failed = (
                (profile_position.active and profile_position.advance(time, process_data))
                or self._trips.look(time, process_data)
                or (cyclic_position.cyclic and cyclic_position.advance())
            )
            if failed:
                self._fail(failed)
        except DriveError as error:
            self._fail(error)
        return self._samples.sample(
            time, process_data, not (profile_position.active or cyclic_position.moving)
        )

    def follow(self) -> Sample:
        """Return the next sample while a drive moves by itself, as in homing.

        Statuswords, emergencies and heartbeats are watched as in `sample`; where the axes go is
        not, since only the drive knows.
        """
        if self._trip is not None:
            self._supervise_trip()
        try:
            time = self._process_data.sync()
            self._heartbeats.service()
            self._attend(self._process_data.words)
        except DriveError as error:
            self._fail(error)
        self._trips.arm(time, self._process_data.positions)
        return self._samples.sample(time, self._process_data, reached=False)

    def halt(self) -> None:
        """Bring every axis to rest with its profile deceleration; the drives stay powered."""
        self._refuse_after_trip()
        self._cyclic_position.abandon()
        try:
            self._profile_position.halt()
        except DriveError as error:
            self._fail(error)

    def reset(self) -> None:
        """Power the axes on again after a trip (see `drivers.drive_bus.DriveBus`)."""
        if self._trip is None:
            return
        if not self._inside:
            raise self._trip
        with interrupts_held():
            self._stop()
            self._shutdown.switch_off()
            self._note(self._shutdown.conclude())
        left = [
            s.label for s, off in zip(self._servers, self._shutdown.off, strict=True) if not off
        ]
        if left:
            raise DriveFault(
                f"{', '.join(left)}: not shown to be off, so nothing is powered on again; leave, "
                "and check the drive"
            )
        self._note(self._shutdown.problems)
        self._shutdown.forget()
        self._heartbeats.watch()
        self._supervision.forget()
        self._trip, self._words = None, ()
        try:
            for server in self._servers:
                self._power.make_safe(server, reset_fault=True)
            self._cycle()
            self._power_on()
        except DriveError as error:
            self._fail(error)

    def _connect(self) -> None:
        drives = self._drives
        expected = [cob_id for axis in drives.axes for cob_id in answers(axis)]
        self._channel = sync_channel(self._bus, self._requested, self._period, expected)
        self._clock = choose_sync_clock(self._channel, self._requested, self._period)
        network = PumpedNetwork(self._channel, synchronous=self._clock.synchronous)
        if isinstance(self._channel, KernelSync):
            self._channel.deliver = network.dispatch
        self._servers = [
            RemoteDictionary(network, axis.node, axis.name, drives.sdo_timeout)
            for axis in drives.axes
        ]
        self._communications = [
            Communication.predefined(axis, server.label)
            for axis, server in zip(drives.axes, self._servers, strict=True)
        ]
        self._supervision = Supervision(self._servers)
        nodes = [server.node for server in self._servers]
        self._emergencies = Emergencies(network, nodes, self._supervision.take_emergency)
        self._process_data = SyncProcessData(network, drives.axes, self._clock)
        now = self._clock.now
        self._heartbeats = Heartbeats(
            network,
            drives.master_node,
            {server.node: server.label for server in self._servers},
            drives.heartbeat_period,
            drives.heartbeat_timeout,
            now,
        )
        network.idle = self._heartbeats.beat
        self._power = Power(self._process_data, self._servers, self._supervision)
        self._shutdown = Shutdown(
            self._process_data,
            self._heartbeats,
            self._servers,
            drives.axes,
            self._period,
            drives.heartbeat_timeout,
            self._power.switch_off,
        )
        self._unsupervised = max(UNSUPERVISED * drives.heartbeat_timeout, 3 * self._period)
        self._commissioned: list[RemoteDictionary] = []
        self._running = False
        self._network = network
        self._missing = MissingTelegrams(self._servers, self._collect_late)
        self._words = ()

    def _check_and_configure(self) -> None:
        self._axes, self._limits = check_and_configure(
            self._servers,
            self._drives,
            self._period,
            self._power,
            self._commissioned,
            self._communications,
            self._keeper,
            reset_faults=self._reset_faults,
        )
        self._process_data.wire(self.transmitted)
        self._emergencies.listen([drive.emergency for drive in self._communications])
        self._heartbeats.requests = [
            guarding_request(drive.node) for drive in self._communications if drive.guarded
        ]
        self._note(note for server in self._servers for note in server.notes)
        pairs = zip(self._limits, self._drives.axes, strict=True)
        self._limited = axes = tuple(limits.of(axis) for limits, axis in pairs)
        process_data, servers, period = self._process_data, self._servers, self._period
        self._profile_position = ProfilePosition(process_data, servers, axes, period)
        self._trips = Trips(axes, period)
        self._cyclic_position = CyclicPosition(
            process_data, servers, axes, self._trips, period, self.follow
        )

    def _start(self) -> None:
        for server in self._servers:
            server.enter_operational()
        self._running = True
        self._heartbeats.watch()
        self._heartbeats.hurry()  # a drive watches from the first heartbeat on, not before
        self._supervision.forget()
        ends = self._clock.now() + 1.0
        self._cycle()
        while self._process_data.irregular:
            if self._clock.now() > ends:
                silent = [
                    server.label
                    for server, flag in zip(self._servers, self._process_data.flags, strict=True)
                    if flag
                ]
                raise NodeSilent(
                    f"{'; '.join(silent)}: does not answer each SYNC with one TPDO of the mapped "
                    "length; check that no other master is on the bus, and the bus load"
                )
            self._cycle()

    def _collect_late(self) -> None:
        self._heartbeats.hurry()
        self._network.pump(0.0)

    def _cycle(self) -> None:
        self._process_data.sync()
        self._heartbeats.service()
        if self._heartbeats.trouble:
            raise self._heartbeats.trouble

    def _power_on(self) -> None:
        self._refuse_unwatched()
        self._refuse_outside()
        self._power.walk(State.SWITCHED_ON, self._cycle)
        self._note_offsets("before power-on")
        self._power.walk(State.OPERATION_ENABLED, self._cycle)
        self._clock.skipped = 0
        self._trips.arm(self._clock.now(), self._process_data.positions)

    def _refuse_unwatched(self) -> None:
        """Refuse drives whose watch on us is not as it was set: another master may be at work."""
        for server in self._servers:
            for entry, value in server.kept.items():
                if entry.index in WATCHDOGS and (present := server.get(entry)) != value:
                    raise DriveRefused(
                        f"{server.label}: {entry} is {present} before power-on, {value} was "
                        "written; another master or a restore changed it: end that first"
                    )

    def _refuse_outside(self) -> None:
        """Refuse axes that stand where they must never be, before any is energised."""
        if self._anywhere:
            return
        outside = []
        for axis, scale, counts in zip(
            self._limited, self._scales, self._process_data.positions, strict=True
        ):
            q, limits, slack = scale.position_from_counts(counts), axis.limits, axis.position_window
            if not limits.q_min - slack <= q <= limits.q_max + slack:
                unit = "rad" if axis.joint == "revolute" else "m"
                outside.append(
                    f"{axis.name} (node {axis.node}): stands at {q:.4g} {unit}, must be in "
                    f"[{limits.q_min:g}, {limits.q_max:g}] {unit}; bring it back without power or "
                    "with the maker's tool, or correct zero, sign or limits in the drives file"
                )
        if outside:
            raise LimitExceeded("\n".join(outside))

    def _attend(self, words: tuple[int, ...]) -> None:
        self._words = words
        self._samples.note_limits(words)
        if self._heartbeats.trouble:
            self._fail(self._heartbeats.trouble)
        lost = self._supervision.lost(words)
        if lost is not None:
            self._stop()  # and at rest, before the drive may have to be asked for the reason
            self._shutdown.await_rest()
            self._fail(self._supervision.diagnose(self._servers[lost], words[lost]))
        self._note(self._supervision.warnings())

    def _supervise_trip(self) -> NoReturn:
        """See to it that stopped axes stay so, and refuse."""
        if self._inside:
            self._shutdown.supervise()
        self._refuse_after_trip()
        raise AssertionError("unreachable: there was a trip")

    def _refuse_after_trip(self) -> None:
        if self._trip is not None and not self._inside:
            raise self._trip
        if self._trip is not None:
            raise Tripped(
                f"all axes were stopped and stay so until a deliberate reset(): {self._trip}"
            ) from self._trip

    def _unattended(self, elapsed: float) -> Tripped:
        return Tripped(
            f"nobody supervised the axes in motion for {elapsed:.3g} s, at most "
            f"{self._unsupervised:.3g} s may be (half the heartbeat timeout); come back to "
            "sample() sooner, or free the computer of other work"
        )

    def _fail(self, trouble: DriveError) -> NoReturn:
        """Bring all axes to rest, remember why, and raise it."""
        if self._trip is None:
            self._stop()
            self._trip = trouble
            self._shutdown.await_rest()
        raise trouble

    def _stop(self) -> None:
        """Command all axes to stop, once; from then on the shutdown sees to it."""
        self._words = ()
        if self._shutdown.begun:
            return
        decelerations = self._decelerations()
        try:
            speeds = self._speeds()
        except Exception:  # nothing may keep the axes from being stopped
            speeds = [axis.limits.velocity for axis in self._limited]
        self._profile_position.active.clear()
        self._cyclic_position.abandon()
        self._shutdown.begin(speeds, decelerations)

    def _speeds(self) -> list[float]:
        """How fast each axis may be: as measured, or as commanded if that is faster."""
        found = []
        for number, (axis, scale, counts) in enumerate(
            zip(self._limited, self._scales, self._process_data.speeds(), strict=True)
        ):
            limit = axis.limits.velocity
            commanded = max(
                self._cyclic_position.velocity(number), self._profile_position.velocity(number)
            )
            measured = limit if math.isinf(counts) else counts * abs(scale.position)
            fastest = axis.trip.velocity or SPEED_SHARE * limit  # a jump of the encoder is none
            found.append(max(commanded, min(measured, fastest)))
        return found

    def _decelerations(self) -> list[float]:
        """How each axis slows down in a quick stop: as stated, as the drive has it, or as moved."""
        found = []
        for number, (axis, server) in enumerate(zip(self._limited, self._servers, strict=True)):
            slowest = SLOWEST_STOP * self._drives.axes[number].limits.acceleration
            stated = self._limits[number].stop_deceleration or axis.limits.acceleration
            ours = max(stated, slowest)
            if server.missing & {objects.QUICK_STOP_OPTION, objects.QUICK_STOP_DECELERATION}:
                ours = min(
                    ours, self._profile_position.deceleration(number)
                )  # it may take that of 6084
            found.append(axis.quick_stop_deceleration or ours)
        return found

    def _note(self, notes: Iterable[str]) -> None:
        new = tuple(notes)
        self.notes += new
        for note in new:
            log.warning("%s", note)

    def _note_offsets(self, when: str) -> None:
        self._note(offsets(self._process_data, self._drives.axes, self._beating, when))

    def _beating(self) -> None:
        self._process_data.sync()
        self._heartbeats.beat()

    def _leave_for_certain(self, error: BaseException | None) -> None:
        """Leave, also where an interrupt comes before it can be held back."""
        pressed: KeyboardInterrupt | None = None
        while self._inside:
            try:
                self._leave(error)
            except KeyboardInterrupt as again:
                pressed = again
        if pressed is not None:
            raise pressed

    def _leave(self, error: BaseException | None) -> None:
        with interrupts_held():
            if not self._inside:
                return
            problems, complete = self._switch_off()
            self._close_settings()
            self._commissioned, self._running = [], False
            self._inside, self._trip = False, _outside()
            problems += self._close()
            if getattr(self._bus, "recorded", False):
                problems = []
            text = "powering off" + ("" if complete else " is incomplete, press the emergency stop")
            text += ": " + "; ".join(problems)
            if problems:
                log.error("%s", text)
                if error is not None:
                    error.add_note(text)
        if problems and error is None:
            raise DriveFault(text)

    def _switch_off(self) -> tuple[list[str], bool]:
        """Stop and switch off all drives; put back what those held that are shown to be off.

        With that their watchdogs are released. Returns what went wrong, and whether all are off.
        """
        off = self._switch_off_running() if self._running else self._switch_off_standing()
        ends = monotonic() + RESTORING
        for server in self._commissioned:
            if server in off and monotonic() < ends:
                with suppress(Exception):  # what is not put back is reported by `_close_settings`
                    self._keeper.restore(server)
        return self._shutdown.problems, set(self._commissioned) <= off

    def _switch_off_running(self) -> set[RemoteDictionary]:
        shutdown = self._shutdown
        self._stop()
        shutdown.switch_off()
        if all(shutdown.off):
            with suppress(Exception):
                self._note_offsets("after power-off")
        self._note(shutdown.conclude())
        return {s for s, off in zip(self._servers, shutdown.off, strict=True) if off}

    def _switch_off_standing(self) -> set[RemoteDictionary]:
        """Switch off drives of which no process data come yet, and which were never energised."""
        off = set()
        for server in self._commissioned:
            try:
                self._power.switch_off(server)
                off.add(server)
            except Exception as error:
                self._heartbeats.cease()
                self._shutdown.problems.append(
                    f"{server.label}: not shown to be off ({error}); its watchdog stays armed and "
                    "our heartbeat has ceased"
                )
        return off

    def _close(self) -> list[str]:
        """Shut down what is ours of the bus; return what went wrong."""
        problems = []
        ours = [self._bus] if self._owns_bus else []
        if self._channel is not self._bus:
            ours.insert(0, self._channel)
        for bus in ours:
            try:
                bus.shutdown()
            except Exception as error:
                problems.append(f"the bus cannot be shut down: {error}")
        return problems

    def _close_settings(self) -> None:
        try:
            self._note(self._keeper.close(self._servers, self._commissioned))
        except FileError as error:  # the axes are off, and what was kept before is on the disk
            self._note([str(error)])


def open_drive_bus(
    drives: DrivesFile,
    interface: str,
    channel: str,
    bus_options: Mapping[str, object] | None = None,
    pacing: PacingName = "auto",
    frame_log: Path | None = None,
    keeper: SettingsKeeper | None = None,
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
        See `drivers.canopen.sync_clock.choose_sync_clock`.
    frame_log : path, optional
        Where to log all frames (see `drivers.can_bus.frame_log`).
    keeper : SettingsKeeper, optional
        See `CanopenDriveBus`.

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
    return CanopenDriveBus(bus, drives, pacing=pacing, owns_bus=True, keeper=keeper)
