"""Connections with an incomplete request, and the owner of a connection.

A request gets a thread only when complete; so a client that sends byte by byte, or nothing, holds
one of `WAITING_MAX` entries of a list and no thread: for `DEADLINE` at most, and until others need
the entry.
"""

from __future__ import annotations

import os
import re
import socket
import sys
import time
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

DEADLINE = 5.0
"""Time limit for a complete request [s]: some ten round trips of a slow mobile network."""
WAITING_MAX = 128
"""Maximum number of connections without a complete request; a new one replaces the oldest."""
BODY_MAX = 4096
"""Maximum bytes of a body, sufficient for a push."""
REQUEST_MAX = 16_384 + BODY_MAX
"""Maximum bytes of a request; browsers send some 1 kB."""
_LENGTH = re.compile(rb"^content-length:[ \t]*(\d{1,9})[ \t]*\r?$", re.I | re.M)


class TooLarge(Exception):
    """Request of more than `REQUEST_MAX` bytes."""


@dataclass(slots=True, eq=False)
class Incoming:
    """Connection with a partial request.

    Attributes
    ----------
    connection : socket
        Non-blocking socket.
    data : bytearray
    ends : float
        End of the time limit, on the monotonic clock [s].
    """

    connection: socket.socket
    data: bytearray = field(default_factory=bytearray)
    ends: float = field(default_factory=lambda: time.monotonic() + DEADLINE)

    def receive(self) -> bytes | None:
        """Receive available data; return the request once complete.

        Raises
        ------
        OSError
            The connection is closed or broken.
        TooLarge
        """
        try:
            chunk = self.connection.recv(REQUEST_MAX)
        except BlockingIOError:
            return None
        if not chunk:
            raise ConnectionResetError
        self.data += chunk
        if len(self.data) > REQUEST_MAX:
            raise TooLarge
        head, end, body = bytes(self.data).partition(b"\r\n\r\n")
        length = _LENGTH.search(head)
        if end and len(body) >= min(int(length[1]) if length else 0, BODY_MAX):
            return bytes(self.data)
        return None


def is_ours(connection: socket.socket) -> bool:
    """Return True if the other end is a program of this user or of root, on this computer.

    The caller of `sudo` counts as this user. A connection already closed by its program belongs to
    nobody: the kernel states root as its user. On a system without this information, the result is
    True.
    """
    family = connection.family
    theirs, ours = connection.getpeername()[:2], connection.getsockname()[:2]
    wanted = f"{_format_address(family, *theirs)} {_format_address(family, *ours)}".encode()
    try:
        # columns: number, local address, remote address, state, queues, timers, retries, user,
        # timeout, inode (0 for closed sockets)
        table = Path("/proc/net/tcp6" if family == socket.AF_INET6 else "/proc/net/tcp")
        lines = table.read_bytes().splitlines()
    except OSError:
        return True
    found = next((line.split() for line in lines if wanted in line), [b"0"] * 10)
    owner, inode = int(found[7]), found[9]
    return inode != b"0" and owner in _users()


@cache
def _users() -> frozenset[int]:
    caller = os.environ.get("SUDO_UID", "")
    return frozenset({0, os.getuid(), *([int(caller)] if caller.isdecimal() else [])})


def _format_address(family: int, address: str, port: int) -> str:
    """Format an address as in the kernel's table: words of four bytes in machine order."""
    packed = socket.inet_pton(family, address)
    words = [packed[k : k + 4] for k in range(0, len(packed), 4)]
    return "".join(f"{int.from_bytes(word, sys.byteorder):08X}" for word in words) + f":{port:04X}"
