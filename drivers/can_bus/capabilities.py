"""Capabilities of a bus beyond the interface of python-can.

A bus has a capability if it has a member of that name (`Capabilities`). A bus in front of another
one has only the capabilities in its `capabilities`: passed on are those that need no inspection or
timing of frames. No other module examines the type of a bus.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, cast

from can.interfaces.socketcan import SocketcanBus

if TYPE_CHECKING:
    from collections.abc import Callable

    import can


class BlockSource(Protocol):
    """Bus with block reception: the answers to a SYNC at once."""

    def recv_block(self) -> bytes | None:
        """Return the waiting frames as ``struct can_frame``; None for single reading."""

    def put_back(self, block: bytes) -> None:
        """Return the frames of the last block to the queue of single frames."""

    def send_repeatedly(self, msg: can.Message, times: int) -> list[bytes]:
        """Send a SYNC repeatedly, each after the answers to the previous SYNC.

        Parameters
        ----------
        msg : can.Message
        times : int
            Largest number of SYNCs, at least 1.

        Returns
        -------
        list of bytes
            Blocks of answers to the SYNCs before the last; answers to the last are received as
            usual. Any frame except the usual ones with new process data ends the repetition.
        """


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a bus.

    Attributes
    ----------
    lock_step : bool
        True if time may advance by SYNC alone: answers are queued before `send` returns.
    kernel_sync : bool
        True if the kernel runs `send_periodic` and returns sent frames with time stamps.
    clock : callable
        Clock of the bus [s].
    until_next_sent : callable, optional
        Time until the next sent frame of a recorded session [s].
    blocks : BlockSource, optional
        Block reception, if available.
    """

    lock_step: bool = False
    kernel_sync: bool = False
    clock: Callable[[], float] = time.perf_counter
    until_next_sent: Callable[[], float] | None = None
    blocks: BlockSource | None = None

    @property
    def recorded(self) -> bool:
        """True for a replay, without drives that could stay powered."""
        return self.until_next_sent is not None


def find_capabilities(bus: can.BusABC) -> Capabilities:
    """Return the capabilities of a bus."""
    stated: Capabilities | None = getattr(bus, "capabilities", None)
    return stated or Capabilities(
        lock_step=getattr(bus, "lock_step", False),
        kernel_sync=isinstance(bus, SocketcanBus),
        clock=getattr(bus, "clock", time.perf_counter),
        until_next_sent=getattr(bus, "until_next_sent", None),
        blocks=cast("BlockSource", bus) if hasattr(bus, "recv_block") else None,
    )
