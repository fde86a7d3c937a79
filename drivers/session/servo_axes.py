"""Servo axes on a fieldbus: `DriveBus` for CiA 402 drives.

Entering connects (`session.connection`), checks and configures every drive while off
(`session.check_and_configure`), and once every drive has passed begins a session that powers all of
them on together (`session.session`). There is no thread: time passes in `ServoAxes.sample` only. A
failure stops all axes before it is raised, and latches: nothing moves until `ServoAxes.reset`.
Leaving stops and switches off the axes in any case, restores the drives and releases the bus; a
failure of one step does not prevent the others. Settings are restored, and thus watchdogs released,
only for drives with confirmed power-off.
"""

from __future__ import annotations

import logging
import re
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from drivers.cia402.power import Deadline
from drivers.drive_bus import DriveError, DriveFault, DriveRefused, Tripped
from drivers.found_settings.keeping import SettingsKeeper
from drivers.interrupts import hold_interrupts
from drivers.session.check_and_configure import check_and_configure
from drivers.session.session import Session, SessionState

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from types import TracebackType
    from typing import Self

    from drivers.axis import Axis
    from drivers.drive_bus import AxisInfo, Move, Sample
    from drivers.drives_file import DrivesFile
    from drivers.found_settings.restoring import RestoringOrder
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Connection, Fieldbus

RESTORING = 20.0
"""Longest time for restoring at the end [s]; `hil drives restore` does the rest."""


@dataclass
class Outcome:
    """State of the drives after a session.

    Attributes
    ----------
    off : set of RemoteDictionary
        Drives with confirmed power-off.
    complete : bool
        True if every drive that may have been written to is off.
    problems, notes : list of str
        Failures; further messages for the operator.
    """

    off: set[RemoteDictionary] = field(default_factory=set)
    complete: bool = True
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def message(self) -> str:
        """Failures in a line; empty if there are none."""
        if not self.problems:
            return ""
        incomplete = "" if self.complete else " is incomplete, press the emergency stop"
        return f"powering off{incomplete}: {'; '.join(self.problems)}"


def leave(
    connection: Connection, session: Session | None, keeper: SettingsKeeper, order: RestoringOrder
) -> Outcome:
    """Stop and switch off the drives, restore their settings, and release the bus.

    Parameters
    ----------
    connection : Connection
        Connection to the drives.
    session : Session, optional
        None if not all drives were configured.
    keeper : SettingsKeeper
        Saved settings.
    order : RestoringOrder
        Order of restoring on the bus.
    """
    outcome = Outcome()
    if session is not None and session.state is not SessionState.CHECKED:
        stopping = session.stopping
        stopping.stop()
        stopping.switch_off()
        outcome.notes += stopping.conclude()
        if all(stopping.off):  # by now even a slow drive has refreshed its current
            with suppress(Exception):
                session.note_offsets("after power-off")
        pairs = zip(connection.servers, stopping.off, strict=True)
        outcome.off = {server for server, off in pairs if off}
        outcome.problems += stopping.problems
    else:
        _switch_off_unpowered(connection, outcome)
    trouble = connection.life_sign.trouble
    if session is not None and isinstance(trouble, Tripped) and trouble != session.stopping.trip:
        outcome.notes.append(str(trouble))  # by a foreign command, at or after an interrupt
    outcome.complete = set(connection.written) <= outcome.off
    over = Deadline(RESTORING)
    # axes of one node share its supervision of the master
    on = {server.node for server in connection.written if server not in outcome.off}
    for server in connection.written:
        if server.node not in on and not over.passed:
            try:
                keeper.restore(server, order)
            except Exception as error:  # `SettingsKeeper.close` reports drives not restored
                outcome.notes.append(str(error))
    try:
        outcome.notes += keeper.close(connection.servers, connection.written)
    except FileError as error:  # the axes are off, and earlier values are on the disk
        outcome.notes.append(str(error))
    return outcome


def _switch_off_unpowered(connection: Connection, outcome: Outcome) -> None:
    """Send drives to their final states by SDO: they have no process data yet, and no power."""
    for server in connection.written:
        try:
            connection.power.switch_off(server)
            outcome.off.add(server)
        except Exception as error:
            connection.life_sign.cease()
            outcome.problems.append(
                f"{server.label}: not shown to be off ({error}); its watchdog stays armed and "
                f"{connection.life_sign.name} has stopped"
            )


log = logging.getLogger(__name__)


class ServoAxes:
    """CiA 402 drives as a `drivers.drive_bus.DriveBus`.

    On the wall clock the caller must call `sample` again within the heartbeat timeout of the drives
    file, or the drives stop for lack of a heartbeat; within half of it while axes move, or the axes
    are stopped for lack of supervision.

    Parameters
    ----------
    bus : Fieldbus
        An open bus.
    drives : DrivesFile
        Axes in joint order.
    period : float, optional
        Time between two SYNCs [s]; by default that of the drives file.
    reset_faults : bool
        True to reset drives found in a fault, instead of refusing them.
    owns_bus : bool
        True to shut the bus down when leaving.
    anywhere : bool
        True to power on even if an axis is outside its limits, as before homing.
    keeper : SettingsKeeper, optional
        Store of the settings found in the drives; by default in memory only.
    feed_forward : bool
        True to set the drives up for offsets of velocity and torque, for `stream`.

    Attributes
    ----------
    notes : tuple of str
        Messages for the operator that stop nothing, such as missing objects and warnings of drives;
        the tuple grows.
    """

    def __init__(
        self,
        bus: Fieldbus,
        drives: DrivesFile,
        *,
        period: float | None = None,
        reset_faults: bool = False,
        owns_bus: bool = False,
        anywhere: bool = False,
        keeper: SettingsKeeper | None = None,
        feed_forward: bool = False,
    ) -> None:
        self.notes: tuple[str, ...] = ()
        self._bus, self._drives = bus, drives
        self._period = drives.sync_period if period is None else period
        self._reset_faults, self._owns_bus = reset_faults, owns_bus
        self._anywhere = anywhere
        self._keeper = keeper or SettingsKeeper()
        self._feed_forward = feed_forward
        self._inside = False
        self._connection: Connection | None = None
        self._session: Session | None = None  # the last session, even if ended

    @property
    def period(self) -> float:
        """Time between two SYNCs [s]."""
        return self._period

    @property
    def axes(self) -> tuple[AxisInfo, ...]:
        """Descriptions of the drives; available once entered."""
        return tuple(axis.info for axis in self.held)

    @property
    def held(self) -> tuple[Axis, ...]:
        """Axes with the limits in force, of the drives or the file; available once entered."""
        return self._session.axes if self._session else ()

    @property
    def servers(self) -> tuple[RemoteDictionary, ...]:
        """Object dictionaries of the drives in joint order; available once entered."""
        return self._session.connection.servers if self._session else ()

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the bus; available once entered."""
        return tuple(self._session.connection.remarks()) if self._session else ()

    @property
    def path_index(self) -> float:
        """Index of the set-points that act at the last sample (see `StreamingBus`)."""
        return self._session.path_index if self._session else 0.0

    @property
    def skipped_syncs(self) -> int:
        """SYNCs left out since power-on because their deadline had passed."""
        return self._session.connection.process_data.skipped if self._session else 0

    def __enter__(self) -> Self:
        """Check, configure and power on every drive (see `drivers.drive_bus.DriveBus`).

        Raises
        ------
        DriveRefused, NodeSilent, DriveFault, BusUnavailable
            The axes cannot be powered on; nothing is energised.
        """
        if self._inside:
            raise DriveRefused("the bus has been entered already; leave it first")
        try:
            self._inside, self._session = True, None
            self._connection = self._bus.connect(
                self._drives, self._period, feed_forward=self._feed_forward
            )
            servers = self._connection.servers
            axes = check_and_configure(
                self._connection,
                self._drives,
                self._period,
                self._keeper,
                reset_faults=self._reset_faults,
            )
            self._note(str(note) for server in servers for note in server.notes)
            self._session = Session(
                self._connection,
                self._period,
                axes,
                self._note,
                anywhere=self._anywhere,
                feed_forward=self._feed_forward,
            )
            self._session.start()
        except BaseException as error:
            self._leave_safely(error)
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
            A drive could not be switched off. During another exception, the message is added to
            its notes instead.
        """
        self._leave_safely(exc)

    def move(self, moves: Mapping[int, Move]) -> None:
        """Send set-points to axes and return at once (see `drivers.drive_bus.DriveBus`)."""
        self._require_session().move(moves)

    def stream(
        self,
        path: Sequence[Sequence[float]],
        velocity: Sequence[Sequence[float]] | None = None,
        torque: Sequence[Sequence[float]] | None = None,
        holding: Sequence[Sequence[float]] | None = None,
    ) -> None:
        """Start a path of set-points (see `drivers.drive_bus.StreamingBus`)."""
        self._require_session().stream(path, velocity, torque, holding)

    def sample(self) -> Sample:
        """Return the sample of the next SYNC (see `drivers.drive_bus.DriveBus`)."""
        return self._require_session().sample()

    def samples(self, limit: int) -> Sequence[Sample]:
        """Return the samples of the next SYNCs (see `drivers.drive_bus.DriveBus`)."""
        session = self._require_session()
        return session.samples(limit) if session.looks_ahead else (self.sample(),)

    def follow(self) -> Sample:
        """Return the next sample of a motion planned by a drive, such as homing.

        See `drivers.session.session.Session.follow`.
        """
        return self._require_session().follow()

    def halt(self) -> None:
        """Stop every axis with the profile deceleration; the drives stay powered."""
        self._require_session().halt()

    def reset(self) -> None:
        """Power the axes on again after a trip (see `drivers.drive_bus.DriveBus`)."""
        self._require_session().reset()

    def _require_session(self) -> Session:
        if self._session is None or self._session.state is SessionState.LEFT:
            raise DriveRefused(
                "the drives are not powered: enter the bus first, in a with statement"
            )
        return self._session

    def _note(self, notes: Iterable[str], *, noted: bool = False) -> None:
        new = tuple(notes)
        self.notes += new
        for note in new:
            log.warning("%s", note, extra={"noted": noted})

    def _leave_safely(self, error: BaseException | None) -> None:
        """Leave, even if an interrupt arrives before interrupts are postponed."""
        pressed: KeyboardInterrupt | None = None
        while self._inside:
            try:
                self._leave(error)
            except KeyboardInterrupt as again:
                pressed = again
        if pressed is not None:
            if isinstance(error, DriveError):  # reason of the stop before the interrupt
                pressed.add_note(str(error))
            raise pressed

    def _leave(self, error: BaseException | None) -> None:
        with hold_interrupts():
            if not self._inside:
                return
            try:
                outcome = Outcome()
                if self._connection is not None:
                    self.notes += self.remarks
                    rules = self._bus.rules
                    outcome = leave(self._connection, self._session, self._keeper, rules)
            except Exception:
                self._close()
                raise
            outcome.problems += self._close()
            if self._bus.recorded:
                outcome.problems.clear()
            noted = isinstance(error, Exception)  # commands print the notes of an error
            self._note(outcome.notes, noted=noted)
            if outcome.message and error is None:
                raise DriveFault(outcome.message)
            if outcome.message:
                log.error("%s", outcome.message, extra={"noted": noted})
            if error is not None:
                # without the answer of the bus in parentheses, if the error contains it
                answer = re.escape(str(error).rsplit(": ", 1)[-1]) or "(?!)"
                message = re.sub(rf" \([^()]*{answer}\)", "", outcome.message)
                for note in filter(None, (message, *outcome.notes)):
                    error.add_note(note)

    def _close(self) -> list[str]:
        """Close the connection, and the bus if owned; return failures."""
        problems = []
        connection, self._connection, self._inside = self._connection, None, False
        if self._session is not None:
            self._session.leave()
        ours = [connection.close] if connection is not None else []
        if self._owns_bus:
            ours.append(self._bus.shutdown)
        for close in ours:
            try:
                close()
            except Exception as error:
                problems.append(f"the bus cannot be shut down: {error}")
        return problems
