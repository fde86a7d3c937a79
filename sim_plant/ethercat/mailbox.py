"""Mailboxes of a slave (ETG.1000.4 clause 5.6): requests, queued answers, repetitions.

A counter of 1 to 7 in each direction identifies repetitions: a request received twice is dropped. A
master that has lost an answer toggles the repeat bit of the mailbox for answers, and finds the last
answer there again.
"""

from __future__ import annotations

import enum
import struct
from collections import deque
from typing import TYPE_CHECKING

from sim_plant.ethercat import registers as reg

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_plant.ethercat.controller import Controller

OUT, IN = 0, 1
"""Sync managers of the mailboxes, written and read by the master."""
HEADER = struct.Struct("<HHBB")
_ERROR, COE = 0, 3
"""Supported types of mailbox services."""
_REPEAT = 0x02
WAITING_MAX = 64
"""Maximum number of queued services; further services are lost."""
CROWDED = 8
"""Number of queued services from which on emergencies are dropped in favour of answers."""


class MailboxError(enum.IntEnum):
    """Reason for the refusal of a mailbox service."""

    UNSUPPORTED_PROTOCOL = 2
    SIZE_TOO_SHORT = 6
    INVALID_SIZE = 8


class Mailbox:
    """Both mailboxes of a slave.

    Parameters
    ----------
    controller : Controller
    serve : callable
        Called with the CoE service that came in.

    Attributes
    ----------
    is_stuck : bool
        True if requests are no longer processed, as in firmware that hangs.
    """

    def __init__(self, controller: Controller, serve: Callable[[bytes], None]) -> None:
        self._controller = controller
        self._serve = serve
        self.is_stuck = False
        self.reset()

    def reset(self) -> None:
        """Clear all state, as at INIT."""
        self._waiting: deque[bytes] = deque()
        self._last = b""
        self._counter = self._received = 0
        for manager in (OUT, IN):
            self._controller.set_full(manager, full=False)

    @property
    def capacity(self) -> int:
        """Maximum size of a service in an answer [bytes]."""
        return max(0, self._controller.managers[IN].size - HEADER.size)

    @property
    def is_crowded(self) -> bool:
        """True if the queue is so long that emergencies are dropped."""
        return len(self._waiting) >= CROWDED

    def send(self, service: bytes) -> None:
        """Queue a CoE service for the master."""
        self._queue(COE, service)

    def work(self) -> None:
        """Process a request and publish a queued answer, after a frame has passed."""
        if self._controller.is_full(OUT) and not self.is_stuck:
            content = self._controller.content(OUT)
            self._controller.set_full(OUT, full=False)
            self._take(content)
        self._repeat()
        self._publish()

    def _take(self, content: bytes) -> None:
        if len(content) < HEADER.size:
            return
        size, _, _, kind = HEADER.unpack_from(content)
        counter = kind >> 4 & 0x07
        if counter and counter == self._received:
            return
        self._received = counter
        if kind & 0x0F != COE:
            self._refuse(MailboxError.UNSUPPORTED_PROTOCOL)
        elif size > len(content) - HEADER.size:
            self._refuse(MailboxError.INVALID_SIZE)
        elif size < 2:
            self._refuse(MailboxError.SIZE_TOO_SHORT)
        else:
            self._serve(content[HEADER.size : HEADER.size + size])

    def _refuse(self, error: MailboxError) -> None:
        self._queue(_ERROR, struct.pack("<HH", 1, error))

    def _queue(self, kind: int, service: bytes) -> None:
        if len(self._waiting) < WAITING_MAX:
            self._counter = self._counter % 7 + 1
            head = HEADER.pack(len(service), 0, 0, kind | self._counter << 4)
            self._waiting.append(head + service)
            self._publish()

    def _publish(self) -> None:
        if self._waiting and not self._controller.is_full(IN):
            self._put(self._waiting.popleft())

    def _put(self, content: bytes) -> None:
        manager = self._controller.managers[IN]
        if not (manager.is_active and manager.start >= reg.PROCESS_MEMORY):
            return
        self._last = content
        end = min(manager.start + manager.size, reg.MEMORY_SIZE)
        self._controller.memory[manager.start : end] = content.ljust(manager.size, b"\0")[
            : end - manager.start
        ]
        self._controller.set_full(IN, full=True)

    def _repeat(self) -> None:
        manager = self._controller.managers[IN]
        asked = manager.activate & _REPEAT
        if asked != manager.pdi & _REPEAT:
            if self._last and not self._controller.is_full(IN):
                self._put(self._last)
            self._controller.acknowledge_repeat(IN, asked)
