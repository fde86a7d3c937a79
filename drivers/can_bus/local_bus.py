"""CAN between processes of a machine without CAN in the kernel: python-can's ``local``.

``can.Bus("name", interface="local")``: every bus on a channel has a Unix datagram socket in the
channel's folder, and sends each frame to all others as the kernel's ``struct can_frame``. There is
no server. Frames arrive whole and in order, and none is lost: with a full queue the sender waits,
as on a bus under load, and receives meanwhile, so that two senders do not block each other. A peer
that hangs misses frames beyond its queue, as a CAN node with a full buffer does; a dead peer is
dropped at the next frame. The time stamp of a frame is the kernel's time of sending.

Other users of the machine cannot read, send or delete: the channel's folder belongs to this user
alone (mode 0700), is no link, cannot be replaced by others, and only sockets of this user with a
name given by this module are connected or removed.
"""

from __future__ import annotations

import os
import re
import select
import socket
import stat
import struct
import sys
import tempfile
import time
from collections import deque
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import can

from drivers.sync_clock import LOCK_STEP_WAIT, poll_actively

if TYPE_CHECKING:
    from can.typechecking import CanFilters, Channel

PATIENCE = 0.25
"""Time with a full queue after which a peer counts as hanging [s]."""

SLICE = 0.001
"""Period at which a waiting sender empties its own queue [s]."""

_GLANCE = 0.05
"""Period of the search for a first peer [s]."""

FD_SETSIZE = 1024
"""Smallest file descriptor that `select` does not accept."""

_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_STAMPS, _TIMESPEC = 35, struct.Struct("@ll")
"""SO_TIMESTAMPNS of Linux, missing in Python's socket module: seconds, nanoseconds."""
_ANCILLARY = socket.CMSG_SPACE(_TIMESPEC.size)
_numbers = count()
_MEMBER = re.compile(r"\d+-\d+")  # process number, and bus number in the process
_CHANNEL = re.compile(r"\w[\w.-]*")


class LocalBus(can.BusABC):
    """One member of a channel.

    Parameters
    ----------
    channel : str
        Letters, digits, dots, underscores and hyphens, the first no dot and no hyphen. Buses of one
        user and machine with the same name are connected.
    can_filters : optional
        As in python-can.
    receive_own_messages : bool
        True to receive sent frames.

    Raises
    ------
    can.CanInitializationError
        The channel's name is not plain, or its folder cannot be made, is a link, or is open to
        other users.
    """

    def __init__(
        self,
        channel: Channel = "local",
        can_filters: CanFilters | None = None,
        *,
        receive_own_messages: bool = False,
        **_: Any,
    ) -> None:
        self._folder = _own_folder(str(channel))
        self._echo = receive_own_messages
        self._inbox: deque[tuple[float, bytes]] = deque()
        self._peers: dict[Path, socket.socket] = {}
        self._hanging: set[Path] = set()
        self._seen = -1
        self._address = self._folder / f"{os.getpid()}-{next(_numbers)}"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        if sys.platform == "linux":
            self._socket.setsockopt(socket.SOL_SOCKET, _STAMPS, 1)
        self._arrivals = select.poll()
        self._arrivals.register(self._socket, select.POLLIN)
        try:
            self._socket.bind(str(self._address))
        except OSError as error:
            self._socket.close()
            raise can.CanInitializationError(
                f"{self._folder}: {error.strerror or error}; choose a shorter channel name, or a"
                " folder of shorter path with XDG_RUNTIME_DIR"
            ) from error
        self._announce()
        self.channel_info = f"local channel {channel}"
        super().__init__(channel, can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to the other members of the channel.

        Parameters
        ----------
        timeout : float, optional
            Longest wait for a full queue, instead of `PATIENCE` [s].

        Raises
        ------
        can.CanOperationError
            The bus is shut down, or the frame is no classical CAN frame.
        """
        if msg.is_fd:
            raise can.CanOperationError("no CAN FD on a local channel: send classical frames")
        identifier = (
            msg.arbitration_id
            | (_EXTENDED if msg.is_extended_id else 0)
            | (_REMOTE if msg.is_remote_frame else 0)
            | (_ERROR if msg.is_error_frame else 0)
        )
        frame = _FRAME.pack(identifier, msg.dlc, bytes(msg.data))
        self._look_around()
        for address, peer in list(self._peers.items()):
            self._pass(frame, address, peer, PATIENCE if timeout is None else timeout)
        if self._echo:
            self._inbox.append((time.time(), frame))

    def await_peer(self, timeout: float) -> None:
        """Wait until another bus is on the channel, at most `timeout` [s]; else leave the channel.

        Raises
        ------
        can.CanInitializationError
            No other bus came.
        """
        ends = time.monotonic() + timeout
        self._look_around()
        while not self._peers:
            if time.monotonic() >= ends:
                self.shutdown()
                raise can.CanInitializationError(
                    "no other program on this channel; start the program with the drives first, "
                    f"as user {os.getuid()} and with the same XDG_RUNTIME_DIR and TMPDIR (folder "
                    f"{self._folder})"
                )
            time.sleep(_GLANCE)
            self._look_around()

    def shutdown(self) -> None:
        """Leave the channel."""
        super().shutdown()
        if self._address.exists():
            self._address.unlink()
            self._announce()
        self._socket.close()
        for peer in self._peers.values():
            peer.close()
        self._peers.clear()

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._inbox:
            self._collect()
        if not self._inbox and timeout != 0 and self._socket.fileno() >= 0:
            if timeout is None or timeout >= LOCK_STEP_WAIT:
                poll_actively(self._receive_one)
            if not self._inbox:
                self._wait(timeout)
                self._collect(1)
        if not self._inbox:
            return None, False
        instant, frame = self._inbox.popleft()
        identifier, size, data = _FRAME.unpack(frame)
        remote = bool(identifier & _REMOTE)
        message = can.Message(
            timestamp=instant,
            arbitration_id=identifier & 0x1FFF_FFFF,
            is_extended_id=bool(identifier & _EXTENDED),
            is_remote_frame=remote,
            is_error_frame=bool(identifier & _ERROR),
            dlc=size,
            data=None if remote else data[:size],
            channel=self._folder.name,
        )
        return message, False

    def _receive_one(self) -> deque[tuple[float, bytes]] | None:
        """Receive a waiting frame; return the inbox, None if empty."""
        self._collect(1)
        return self._inbox or None

    def _wait(self, timeout: float | None) -> None:
        """Wait for a frame; `select` resolves microseconds, `poll` whole milliseconds."""
        if self._socket.fileno() < FD_SETSIZE:
            select.select([self._socket], [], [], None if timeout is None else max(0.0, timeout))
        else:
            self._arrivals.poll(None if timeout is None else max(0.0, timeout * 1e3))

    def _collect(self, most: int = 1000) -> None:
        """Move frames from the socket's short queue to the inbox, with the time of sending [s]."""
        try:
            for _ in range(most):
                frame, stamps, _, _ = self._socket.recvmsg(_FRAME.size, _ANCILLARY)
                instant = time.time()
                for level, kind, data in stamps:
                    if (level, kind) == (socket.SOL_SOCKET, _STAMPS):
                        seconds, nanoseconds = _TIMESPEC.unpack_from(data)
                        instant = seconds + 1e-9 * nanoseconds
                self._inbox.append((instant, frame))
        except BlockingIOError:
            pass
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: this bus is shut down") from error

    def _pass(self, frame: bytes, address: Path, peer: socket.socket, patience: float) -> None:
        """Put a frame into a peer's queue; do not wait again for a hanging peer."""
        ends = time.monotonic() + (0.0 if address in self._hanging else patience)
        while True:
            try:
                peer.send(frame)
            except BlockingIOError:
                if time.monotonic() >= ends:
                    return self._hanging.add(address)
                self._collect()
                select.select([], [peer], [], SLICE)
            except (ConnectionError, FileNotFoundError):
                return self._drop(address)
            else:
                return self._hanging.discard(address)

    def _announce(self) -> None:
        """Set the folder's time stamp to now, since its own time stamps are too coarse."""
        now = time.time_ns()
        os.utime(self._folder, ns=(now, now))

    def _look_around(self) -> None:
        """Update the list of members if the folder has changed."""
        try:
            changed = self._folder.stat().st_mtime_ns
        except OSError as error:
            raise can.CanOperationError(f"{self._folder} is gone: {error.strerror}") from error
        if changed == self._seen:
            return
        self._seen = changed
        there = {path for path in self._folder.iterdir() if path != self._address and _ours(path)}
        for address in set(self._peers) - there:
            self._peers.pop(address).close()
        for address in there - set(self._peers):
            peer = self._peers[address] = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            peer.setblocking(False)
            try:
                peer.connect(str(address))
            except (ConnectionError, FileNotFoundError):
                self._drop(address)

    def _drop(self, address: Path) -> None:
        self._peers.pop(address).close()
        address.unlink(missing_ok=True)


def _ours(path: Path) -> bool:
    """Return True if a path is a socket of this user made by a bus, and no link."""
    if not _MEMBER.fullmatch(path.name):
        return False
    try:
        state = path.lstat()
    except FileNotFoundError:  # its bus has left in the meantime
        return False
    return stat.S_ISSOCK(state.st_mode) and state.st_uid == os.getuid()


def _own_folder(channel: str) -> Path:
    """Make the folder of a channel, or return an existing one that only this user can access."""
    if not _CHANNEL.fullmatch(channel):
        raise can.CanInitializationError(
            "a channel must be a name such as bench, of letters, digits, '.', '_' and '-', that"
            " begins with a letter, a digit or '_'"
        )
    stated = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(stated or tempfile.gettempdir()).resolve()
    if not os.access(folder, os.W_OK | os.X_OK) or not folder.is_dir():  # for example after su
        raise can.CanInitializationError(
            f"{folder}: {'XDG_RUNTIME_DIR' if stated else 'TMPDIR'} names a folder that cannot be"
            f" used: unset it, or name a folder of your own with mode 0700"
        )
    try:
        for above in (folder, *folder.parents):
            _refuse_changeable(above)
        for name in (f"can-local-{os.getuid()}", channel):
            folder /= name
            with suppress(FileExistsError):
                folder.mkdir(mode=0o700)
            _refuse_foreign(folder)
    except OSError as error:
        raise can.CanInitializationError(
            f"{folder}: {error.strerror or error}; choose a shorter channel name, or another folder"
            " of your own with XDG_RUNTIME_DIR"
        ) from error
    return folder


def _refuse_changeable(folder: Path) -> None:
    """Refuse a folder whose entries another user can replace."""
    state = folder.stat()
    # the owner of / can do everything in any case: root, or the user who started the container
    trusted = state.st_uid in {0, os.getuid(), Path("/").stat().st_uid}
    if trusted and (state.st_mode & stat.S_ISVTX or not state.st_mode & 0o022):
        return
    raise can.CanInitializationError(
        f"{folder}: owned by user {state.st_uid} with mode {stat.S_IMODE(state.st_mode):04o}: "
        "others can replace folders of channels; set XDG_RUNTIME_DIR to a folder of mode 0700 in "
        "your home, or remove the write permission of others (chmod go-w)"
    )


def _refuse_foreign(folder: Path) -> None:
    """Refuse a channel's folder that is a link, of another user, or writable for another user.

    A folder that others can only read, as made by earlier versions, is made private.
    """
    state = folder.lstat()
    if not stat.S_ISDIR(state.st_mode):
        found = "is a link" if stat.S_ISLNK(state.st_mode) else "is not a folder"
    elif state.st_uid != os.getuid():
        found = f"belongs to user {state.st_uid}"
    elif state.st_mode & 0o022:
        found = f"has mode {stat.S_IMODE(state.st_mode):04o}, in which others can write"
    else:
        return folder.chmod(0o700)
    raise can.CanInitializationError(
        f"{folder}: {found}; a channel's folder must be user {os.getuid()}'s own with mode 0700:"
        " remove it, or set XDG_RUNTIME_DIR to a folder of your own"
    )
