"""Log of the frames of a run, in any format that python-can writes.

A `FrameLog` is a bus between the driver and the actual bus. It logs frames of both directions in
the order of the driver's calls; `drivers.can_bus.replay_bus` can repeat the run from the log. A
thread writes, so a stalled disk does not stop the robot; after a kill the log lacks the last
tenth of a second in line-based formats (.asc, .log, .trc, .csv), and up to 128 kB, some thousand
frames, in .blf.

Times are those of `FrameLog.clock`, also used by the driver: instants of SYNC in the recordings are
those of the log to the microsecond. A received frame keeps the time stamp of its interface if this
is between the previous frame and the end of the driver's wait; otherwise it gets the time of the
driver's call. The driver's heartbeats, ignored by a replay, get the time of the previous frame. In
lock-step, time is that of the plant and does not advance during sending.
"""

from __future__ import annotations

import logging
import math
import time
from collections import deque
from contextlib import suppress
from threading import Event, Thread
from typing import TYPE_CHECKING

import can

from checked_files.yaml_file import FileError
from drivers.can_bus.capabilities import Capabilities, find_capabilities
from drivers.can_bus.replay_bus import SYNC, is_heartbeat

if TYPE_CHECKING:
    from pathlib import Path

    from can.typechecking import CanFilters

log = logging.getLogger(__name__)

PAUSE = 0.05
"""Period of the writing thread [s]."""
WAITING_MAX = 100_000
"""Largest number of frames waiting for the disk: half a minute or more with six axes."""
TICK = 1e-6
"""Resolution of the logs [s]."""
CREDIBLE = 1.0
"""Largest age of a usable time stamp [s]: older stamps are not by the clock of this computer."""
PATIENCE = 30.0
"""Longest wait for the disk before the log is given up [s]."""


class FrameLog(can.BusABC):
    """Bus that logs the frames of another bus, and owns that bus.

    Parameters
    ----------
    bus : can.BusABC
    path : Path
        File to write; the suffix selects the format.

    Raises
    ------
    FileError
        The file exists, cannot be written, or python-can lacks the format.
    """

    def __init__(self, bus: can.BusABC, path: Path) -> None:
        self._path = path
        try:
            path.open("x").close()
        except FileExistsError as error:
            raise FileError(f"{path}: already exists; choose another name") from error
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {error.strerror}") from error
        try:
            self._writer = can.Logger(path)
        except Exception as error:  # missing libraries of a format raise errors of any type
            path.unlink()
            raise FileError(
                f"{path}: {error}; choose .asc or .log (best after a kill), or .blf"
            ) from error
        self._bus = bus
        self.lock_step = find_capabilities(bus).lock_step
        self.channel_info = bus.channel_info
        self._name = "_".join(bus.channel_info.split())
        self._epoch = 0.0 if self.lock_step else round(time.time(), 6)
        self._zero: float | None = None
        self._reading = 0.0
        self._begun = False
        self._latest = 0.0
        self._sync: can.Message | None = None
        self._waiting: deque[can.Message] = deque()
        self._trouble: Exception | None = None
        self._closing = Event()
        self._thread = Thread(target=self._write, name=str(path), daemon=True)
        super().__init__(self._name)
        try:
            self._thread.start()
        except BaseException:
            super().shutdown()
            self._writer.stop()
            raise

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities that can be logged and replayed: without SYNC from the kernel."""
        return Capabilities(lock_step=self.lock_step, clock=self.clock)

    def clock(self) -> float:
        """Return the time since the first call, in whole microseconds [s]."""
        before, self._reading = self._reading, self._now()
        if self._sync is not None and not self.lock_step:
            # as `WallClock`, which reads the clock immediately before sending SYNC
            self._latest = round(self._reading - (self._reading - before) / 2, 6)
            self._log_sync()
        return self._reading

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send and log a frame (see `can.BusABC.send`)."""
        self._bus.send(msg, timeout)
        self._log_sync()
        if self._begun and not (self.lock_step or is_heartbeat(msg) or msg.arbitration_id == SYNC):
            self._latest = self._now()
        self._begun = True  # earlier instants precede the driver's zero of time
        sent = can.Message(
            arbitration_id=msg.arbitration_id,
            is_extended_id=msg.is_extended_id,
            is_remote_frame=msg.is_remote_frame,
            dlc=msg.dlc,
            data=msg.data,
            is_rx=False,
        )
        if msg.arbitration_id == SYNC:
            self._sync = sent  # its instant is known after the driver has read the clock
        else:
            self._note(sent)
        if len(self._waiting) > WAITING_MAX:
            self._catch_up()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Receive and log a frame (see `can.BusABC.recv`).

        Raises
        ------
        FileError
            The log can no longer be written; raised once.
        """
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise FileError(f"{self._path}: cannot be written: {trouble}") from trouble
        self._log_sync()
        ends = self._latest
        if timeout != 0.0 and not self.lock_step:
            ends = math.inf if timeout is None else self._reading + timeout
        frame = self._bus.recv(timeout)
        if frame is not None:
            if self.lock_step:
                self._latest = frame.timestamp
            else:
                # arrival as seen by the driver: after the previous frame, within its wait
                now, arrived = self._now(), frame.timestamp - self._epoch
                arrived = arrived if now - CREDIBLE < arrived <= now else now
                self._latest = max(self._latest, min(arrived, ends - TICK))
            self._note(frame)
        elif not self.lock_step:
            self._latest = max(self._latest, ends) + TICK
        return frame

    def shutdown(self) -> None:
        """Write the remaining frames, close the log and shut the bus down."""
        super().shutdown()
        self._log_sync()
        self._closing.set()
        self._thread.join()
        if self._trouble is not None:
            log.error("%s: cannot be written: %s", self._path, self._trouble)
            self._trouble = None
        self._bus.shutdown()

    def _apply_filters(self, filters: CanFilters | None) -> None:
        self._bus.set_filters(filters)

    def _now(self) -> float:
        reading = time.perf_counter()
        if self._zero is None:
            self._zero = reading
        return round(reading - self._zero, 6)

    def _log_sync(self) -> None:
        """Log a SYNC once its instant is known."""
        if self._sync is not None:
            self._note(self._sync)
            self._sync = None

    def _note(self, frame: can.Message) -> None:
        frame.timestamp = self._epoch + self._latest
        frame.channel = self._name
        self._waiting.append(frame)

    def _catch_up(self) -> None:
        ends = time.monotonic() + PATIENCE
        while self._waiting and self._thread.is_alive():
            if time.monotonic() > ends:
                raise FileError(f"{self._path}: no frame saved for {PATIENCE:g} s; check the disk")
            time.sleep(0.001)

    def _write(self) -> None:
        try:
            while not self._closing.wait(PAUSE):
                self._empty()
            self._empty()
            self._writer.stop()
        except Exception as error:  # each format has its own errors; `recv` raises them
            self._trouble, self._waiting = error, deque(maxlen=0)
            with suppress(Exception):
                self._writer.stop()

    def _empty(self) -> None:
        while self._waiting:
            self._writer.on_message_received(self._waiting.popleft())
        if isinstance(self._writer, can.io.generic.FileIOMessageWriter):
            self._writer.file.flush()
        if isinstance(self._writer, can.SqliteWriter):
            # .db has a thread of its own, which drops waiting frames when stopped
            ends = time.monotonic() + PATIENCE
            while not self._writer.buffer.empty():
                if time.monotonic() > ends:
                    raise TimeoutError(f"no frame was written to the database for {PATIENCE:g} s")
                time.sleep(0.001)


def log_frames(bus: can.BusABC, path: Path) -> FrameLog:
    """Put a log on a bus; shut the bus down if that fails (`FileError`: see `FrameLog`)."""
    try:
        return FrameLog(bus, path)
    except BaseException:
        bus.shutdown()
        raise
