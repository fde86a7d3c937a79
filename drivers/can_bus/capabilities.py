"""What a bus can do beyond python-can's interface: each ability declared once, and looked up here.

A bus has an ability by having the members of its protocol. A bus that stands in front of another
one has those abilities alone which it states in `capabilities`: what passes through it unnoticed
may be passed on, what it must see or time by itself may not. Nothing else asks a bus what it is.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from can.interfaces.socketcan import SocketcanBus

if TYPE_CHECKING:
    from collections.abc import Callable

    import can


@runtime_checkable
class KeepsStep(Protocol):
    """A bus with drives behind it whose time may advance by SYNC alone.

    Attributes
    ----------
    lock_step : bool
        It does: all answers are queued before `send` returns.
    """

    lock_step: bool


@runtime_checkable
class HasClock(Protocol):
    """A bus with a time of its own, as a recorded one."""

    def clock(self) -> float:
        """Time [s]."""


@runtime_checkable
class Recorded(Protocol):
    """A recorded session: no drives are behind this bus that could be left switched on."""

    def until_next_sent(self) -> float:
        """How long until the next frame was sent [s], at least 0."""


@dataclass(frozen=True)
class Capabilities:
    """What a bus can do.

    Attributes
    ----------
    lock_step : bool
        All answers are queued before `send` returns.
    kernel_sync : bool
        `send_periodic` is the kernel's, which hands back what it sent with its time stamp.
    clock : callable
        The time that it goes by [s].
    until_next_sent : callable, optional
        Of a recorded session: how long until the next frame was sent [s].
    """

    lock_step: bool = False
    kernel_sync: bool = False
    clock: Callable[[], float] = time.perf_counter
    until_next_sent: Callable[[], float] | None = None

    @property
    def recorded(self) -> bool:
        """No drives are behind this bus that could be left switched on."""
        return self.until_next_sent is not None


@runtime_checkable
class InFront(Protocol):
    """A bus in front of another one, which states what it can do."""

    @property
    def capabilities(self) -> Capabilities:
        """Return what it passes on of the other's abilities, and its own."""


def capabilities_of(bus: can.BusABC) -> Capabilities:
    """Return what a bus can do."""
    if isinstance(bus, InFront):
        return bus.capabilities
    return Capabilities(
        lock_step=isinstance(bus, KeepsStep) and bus.lock_step,
        kernel_sync=isinstance(bus, SocketcanBus),
        clock=bus.clock if isinstance(bus, HasClock) else time.perf_counter,
        until_next_sent=bus.until_next_sent if isinstance(bus, Recorded) else None,
    )
