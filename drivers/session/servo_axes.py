"""Servo axes on a fieldbus: `DriveBus` for CiA 402 drives.

Entering connects (`session.connection`), checks and configures every drive while off
(`session.check_and_configure`), and once every drive has passed begins a session that powers all of
them on together (`session.session`). There is no thread: time passes in `ServoAxes.sample` only. A
failure stops all axes before it is raised, and latches: nothing moves until `ServoAxes.reset`.
Leaving stops and switches off the axes in any case (`session.leaving`), and releases the watchdogs
of drives with confirmed power-off.
"""

from __future__ import annotations

import logging
import re
from typing import TYPE_CHECKING

from drivers.drive_bus import DriveError, DriveFault, DriveRefused
from drivers.found_settings.keeping import SettingsKeeper
from drivers.interrupts import hold_interrupts
from drivers.session.check_and_configure import check_and_configure
from drivers.session.leaving import Outcome, leave
from drivers.session.session import Session, SessionState

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from types import TracebackType
    from typing import Self

    from drivers.axis import Axis
    from drivers.drive_bus import AxisInfo, Move, Sample
    from drivers.drives_file import DrivesFile
    from drivers.remote_dictionary import RemoteDictionary
    from drivers.session.connection import Connection, Fieldbus

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
        self._session: Session | None = None  # the last one, even if ended

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
            self._session = self._configure(self._connection)
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

    def _configure(self, connection: Connection) -> Session:
        """Check and configure all drives; return the session for power-on."""
        axes = check_and_configure(
            connection, self._drives, self._period, self._keeper, reset_faults=self._reset_faults
        )
        self._note(str(note) for server in connection.servers for note in server.notes)
        return Session(
            connection,
            self._period,
            axes,
            self._note,
            anywhere=self._anywhere,
            feed_forward=self._feed_forward,
        )

    def _note(self, notes: Iterable[str]) -> None:
        new = tuple(notes)
        self.notes += new
        for note in new:
            log.warning("%s", note)

    def _leave_safely(self, error: BaseException | None) -> None:
        """Leave, even if an interrupt arrives before interrupts are postponed."""
        pressed: KeyboardInterrupt | None = None
        while self._inside:
            try:
                self._leave(error)
            except KeyboardInterrupt as again:
                pressed = again
        if pressed is not None:
            if isinstance(error, DriveError):  # the reason of the stop before the interrupt
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
            self._note(outcome.notes)
            if outcome.message:
                log.error("%s", outcome.message)
                if error is not None:
                    # less the answer of the bus in parentheses, if the error contains it
                    message, answer = outcome.message, str(error).rsplit(": ", 1)[-1]
                    if answer:
                        message = re.sub(rf" \([^()]*{re.escape(answer)}\)", "", message)
                    error.add_note(message)
        if outcome.message and error is None:
            raise DriveFault(outcome.message)

    def _close(self) -> list[str]:
        """Close our part of the bus; return failures."""
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
