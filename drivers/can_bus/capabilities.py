"""Capabilities of a bus beyond python-can's interface, each declared once and looked up here.

A bus has an ability by having a member of its name (`Capabilities`). A bus that stands in front of
another one has those abilities alone which it states in `capabilities`: what passes through it
unnoticed may be passed on, what it must see or time by itself may not. Nothing else asks a bus what
it is.
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
    """Bus with block reception: all frames in answer to a SYNC at once."""

    def recv_block(self) -> bytes | None:
        """Return all frames that wait, as ``struct can_frame``; None where they wait singly."""

    def put_back(self, block: bytes) -> None:
        """Have the frames of the block received last wait singly."""

    def send_repeatedly(self, msg: can.Message, times: int) -> list[bytes]:
        """Send a SYNC repeatedly, each after the answers to the previous SYNC.

        Parameters
        ----------
        msg : can.Message
        times : int
            How often at most, at least 1.

        Returns
        -------
        list of bytes
            Blocks that answered all SYNCs but the last; what answers the last is to be received as
            usual. Whatever is more than the same frames with new process data ends the repetition.
        """


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a bus.

    Attributes
    ----------
    lock_step : bool
        Time may advance by SYNC alone: all answers are queued before `send` returns.
    kernel_sync : bool
        `send_periodic` is the kernel's, which hands back what it sent with its time stamp.
    clock : callable
        The time that it goes by [s].
    until_next_sent : callable, optional
        Of a recorded session: how long until the next frame was sent [s].
    blocks : BlockSource, optional
        Where frames are received by the block.
    """

    lock_step: bool = False
    kernel_sync: bool = False
    clock: Callable[[], float] = time.perf_counter
    until_next_sent: Callable[[], float] | None = None
    blocks: BlockSource | None = None

    @property
    def recorded(self) -> bool:
        """No drives are behind this bus that could be left switched on."""
        return self.until_next_sent is not None


def capabilities_of(bus: can.BusABC) -> Capabilities:
    """Return what a bus can do."""
    stated: Capabilities | None = getattr(bus, "capabilities", None)
    return stated or Capabilities(
        lock_step=getattr(bus, "lock_step", False),
        kernel_sync=isinstance(bus, SocketcanBus),
        clock=getattr(bus, "clock", time.perf_counter),
        until_next_sent=getattr(bus, "until_next_sent", None),
        blocks=cast("BlockSource", bus) if hasattr(bus, "recv_block") else None,
    )
