"""CAN between processes of one machine, for kernels that have no CAN: python-can's ``local``.

``can.Bus("name", interface="local")``: every bus on a channel has a Unix datagram socket in the
channel's folder, and a frame goes to all the others as the kernel's ``struct can_frame``. There is
no server. Frames arrive whole, in the order in which they were sent, and none is lost: a full queue
lets the sender wait, as a bus under load would, and it goes on receiving meanwhile, so that two
who send to each other do not wait for ever. A peer who hangs misses what does not fit into its
queue, as the receiver of a CAN node would; one whose process died is dropped at the next frame.
The time stamp of a frame is the kernel's and says when it was sent, however late it is received.

Other users of the machine neither read, send nor delete here: the channel's folder is this user's
alone (mode 0700) and no link, nobody else can put another in its place, and nothing is connected to
or removed that is no socket of this user with a name that this module gives.
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

from drivers.awake import LONG, look_out

if TYPE_CHECKING:
    from can.typechecking import CanFilters, Channel

PATIENCE = 0.25
"""How long a peer may leave its queue full before it counts as hanging [s]."""

SLICE = 0.001
"""How often a waiting sender looks for frames that it must take out of others' way [s]."""

FD_SETSIZE = 1024
"""File descriptors from here on are more than `select` takes."""

_FRAME = struct.Struct("=IB3x8s")
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_STAMPS, _TIMESPEC = 35, struct.Struct("@ll")
"""SO_TIMESTAMPNS of Linux, which Python does not name, and what it gives: seconds, nanoseconds."""
_ANCILLARY = socket.CMSG_SPACE(_TIMESPEC.size)
_numbers = count()
_MEMBER = re.compile(r"\d+-\d+")  # number of the process, number of the bus in it
_CHANNEL = re.compile(r"\w[\w.-]*")


class LocalBus(can.BusABC):
    """One member of a channel.

    Parameters
    ----------
    channel : str
        Letters, digits, dots, underscores and hyphens, the first no dot and no hyphen; same name,
        same machine, same user: same bus.
    can_filters : optional
        As everywhere in python-can.
    receive_own_messages : bool
        Whether sent frames come back.

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
                f"{self._folder}: {error.strerror or error}; choose a short channel name"
            ) from error
        self._announce()
        self.channel_info = f"local channel {channel}"
        super().__init__(channel, can_filters)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame to every other member of the channel.

        Parameters
        ----------
        timeout : float, optional
            How long a full queue is waited for instead of `PATIENCE` [s].

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
            if timeout is None or timeout >= LONG:
                look_out(self._came)
            if not self._inbox:
                self._await(timeout)
                self._collect(1)
        if not self._inbox:
            return None, False
        instant, frame = self._inbox.popleft()
        return self._message(instant, frame), False

    def _came(self) -> deque[tuple[float, bytes]] | None:
        """Take a frame that is there; return the inbox, None if it is empty."""
        self._collect(1)
        return self._inbox or None

    def _await(self, timeout: float | None) -> None:
        """Wait for a frame; `select` keeps a timeout to the microsecond, `poll` to whole ms."""
        if self._socket.fileno() < FD_SETSIZE:
            select.select([self._socket], [], [], None if timeout is None else max(0.0, timeout))
        else:
            self._arrivals.poll(None if timeout is None else max(0.0, timeout * 1e3))

    def _collect(self, most: int = 1000) -> None:
        """Take frames out of the socket's queue, which is short."""
        try:
            for _ in range(most):
                self._inbox.append(self._received())
        except BlockingIOError:
            pass
        except OSError as error:
            raise can.CanOperationError(f"{self.channel_info}: this bus is shut down") from error

    def _received(self) -> tuple[float, bytes]:
        """Return the next frame and when it was sent, which the kernel notes [s]."""
        frame, stamps, _, _ = self._socket.recvmsg(_FRAME.size, _ANCILLARY)
        for level, kind, data in stamps:
            if (level, kind) == (socket.SOL_SOCKET, _STAMPS):
                seconds, nanoseconds = _TIMESPEC.unpack_from(data)
                return seconds + 1e-9 * nanoseconds, frame
        return time.time(), frame

    def _message(self, instant: float, frame: bytes) -> can.Message:
        identifier, size, data = _FRAME.unpack(frame)
        remote = bool(identifier & _REMOTE)
        return can.Message(
            timestamp=instant,
            arbitration_id=identifier & 0x1FFF_FFFF,
            is_extended_id=bool(identifier & _EXTENDED),
            is_remote_frame=remote,
            is_error_frame=bool(identifier & _ERROR),
            dlc=size,
            data=None if remote else data[:size],
            channel=self._folder.name,
        )

    def _pass(self, frame: bytes, address: Path, peer: socket.socket, patience: float) -> None:
        """Put a frame into a peer's queue; one that hangs is not waited for again."""
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
        """Stamp the folder with an instant of its own; its time stamps alone are too coarse."""
        now = time.time_ns()
        os.utime(self._folder, ns=(now, now))

    def _look_around(self) -> None:
        """Find out who is on the channel, if that has changed."""
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
            self._connect(address)

    def _connect(self, address: Path) -> None:
        peer = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        peer.setblocking(False)
        self._peers[address] = peer
        try:
            peer.connect(str(address))
        except (ConnectionError, FileNotFoundError):
            self._drop(address)

    def _drop(self, address: Path) -> None:
        self._peers.pop(address).close()
        address.unlink(missing_ok=True)


def _ours(path: Path) -> bool:
    """Whether a path is a socket of this user that a bus has made, and no link to one."""
    if not _MEMBER.fullmatch(path.name):
        return False
    try:
        state = path.lstat()
    except FileNotFoundError:  # its bus has left meanwhile
        return False
    return stat.S_ISSOCK(state.st_mode) and state.st_uid == os.getuid()


def _own_folder(channel: str) -> Path:
    """Make the folder of a channel, or take the one that is there if it is this user's alone."""
    if not _CHANNEL.fullmatch(channel):
        raise can.CanInitializationError(
            f"channel {channel!r}: must be a name such as bench, of letters, digits, '.', '_' and"
            " '-', that begins with a letter, a digit or '_'"
        )
    folder = Path(os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()).resolve()
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
            f"{folder}: {error.strerror or error}; choose a short channel name, and with"
            " XDG_RUNTIME_DIR a folder of your own"
        ) from error
    return folder


def _refuse_changeable(folder: Path) -> None:
    """Refuse a folder in which another user can replace what this user has made."""
    state = folder.stat()
    # whoever owns / can do everything in any case: root, or the outside of a container
    trusted = state.st_uid in {0, os.getuid(), Path("/").stat().st_uid}
    if trusted and (state.st_mode & stat.S_ISVTX or not state.st_mode & 0o022):
        return
    raise can.CanInitializationError(
        f"{folder}: user {state.st_uid} owns it with mode {stat.S_IMODE(state.st_mode):04o}, so"
        " that others can replace a channel's folder in it; set XDG_RUNTIME_DIR to a folder of"
        " your own with mode 0700, or remove the write permission of others"
    )


def _refuse_foreign(folder: Path) -> None:
    """Refuse a folder of a channel that is a link, belongs to others, or was open to their writing.

    One that others could only read, as earlier versions made it, is closed to them.
    """
    state = folder.lstat()
    if not stat.S_ISDIR(state.st_mode):
        found = "is a link" if stat.S_ISLNK(state.st_mode) else "is no folder"
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
