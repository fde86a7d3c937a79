"""Real-time execution as far as granted: scheduling class, memory, core, idle states.

SYNC on the wall clock is as regular as this process is woken up. A normal process shares its core
with all others, may be moved between cores, may have its memory paged out, and its core may sleep;
each of these sometimes costs milliseconds. `real_time` applies four measures to the calling thread,
as far as they are granted, and yields a hint for each refused measure. On leaving, everything is
restored. Threads started meanwhile, such as the one that writes files, keep the normal scheduling
class.

The priority is below that of the kernel's own threads, among them those of interrupts: frames are
received and sent before the thread that waits for them runs.

Inside `short_slices` a normal thread is woken up sooner, without any rights. Linux first runs the
thread whose slice ends first in virtual time (EEVDF). A short slice ends soon, and from Linux 6.12
on a thread may request one. Its share of the processor stays the same.
"""

from __future__ import annotations

import ctypes
import os
import platform
import struct
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

PRIORITY = 40
"""Priority of SCHED_FIFO, 1 to 99; threaded interrupts have 50."""

SLICE = 100_000
"""Time slice of a normal thread, the shortest granted by Linux [ns]; the default is 0.7 to 2.8 ms,
depending on the number of cores."""

_SET_ATTRIBUTES = {"x86_64": 314, "i686": 351, "armv7l": 380, "aarch64": 274, "riscv64": 274}
"""Numbers of Linux's system call sched_setattr, missing in older C libraries."""
_ATTRIBUTES = struct.Struct("=IIQiIQQQ")
"""Argument of sched_setattr: size, policy, flags, nice, priority, runtime, deadline, period."""
_RESET_ON_FORK = 1
"""Flag of sched_setattr equivalent to `os.SCHED_RESET_ON_FORK`."""

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4
"""Flags of mlockall: present pages, future pages; pages on first use."""
_ISOLATED = Path("/sys/devices/system/cpu/isolated")
_AWAKE = Path("/dev/cpu_dma_latency")


class Linux:
    """System calls of Linux, unavailable on other systems.

    Each method raises `OSError` if refused; the first five return a function that undoes the call.
    """

    def schedule(self, priority: int) -> Callable[[], None]:
        """Set SCHED_FIFO for the calling thread, without inheritance."""
        before, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(priority))

        def undo() -> None:
            # without rights beyond rtprio the flag cannot be cleared: a normal thread with the flag
            # is equivalent
            os.sched_setscheduler(0, before | os.SCHED_RESET_ON_FORK, parameters)
            with suppress(PermissionError):
                os.sched_setscheduler(0, before, parameters)

        return undo

    def slice(self, duration: int) -> Callable[[], None]:
        """Set the time slice [ns] of the calling thread, if normal, and of its descendants."""
        number = _SET_ATTRIBUTES[platform.machine()]
        library = ctypes.CDLL(None, use_errno=True)

        def ask(slice_: int) -> None:
            policy, nice = os.sched_getscheduler(0), os.getpriority(os.PRIO_PROCESS, 0)
            flagged = bool(policy & os.SCHED_RESET_ON_FORK)
            if policy & ~os.SCHED_RESET_ON_FORK != os.SCHED_OTHER:
                return
            of = os.SCHED_OTHER, _RESET_ON_FORK * flagged, nice, 0
            if library.syscall(number, 0, _ATTRIBUTES.pack(_ATTRIBUTES.size, *of, slice_, 0, 0), 0):
                raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))

        ask(duration)
        return lambda: ask(0)

    def lock_memory(self) -> Callable[[], None]:
        """Lock used memory pages against swapping."""
        library = ctypes.CDLL(None, use_errno=True)
        if library.mlockall(_CURRENT | _FUTURE | _ON_FAULT):
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))
        unlock: Callable[[], None] = library.munlockall
        return unlock

    def pin(self, core: int) -> Callable[[], None]:
        """Pin the calling thread to a core."""
        before = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {core})
        return lambda: os.sched_setaffinity(0, before)

    def stay_awake(self) -> Callable[[], None]:
        """Request a wake-up latency of 0 us, for as long as the file is open."""
        descriptor = os.open(_AWAKE, os.O_WRONLY | os.O_CLOEXEC)
        try:
            os.write(descriptor, b"\0\0\0\0")
        except OSError:
            os.close(descriptor)
            raise
        return lambda: os.close(descriptor)

    def cores(self) -> set[int]:
        """Return cores permitted to the calling thread; isolated ones only after pinning."""
        return os.sched_getaffinity(0)

    def isolated(self) -> set[int]:
        """Return the cores of ``isolcpus``, parsed from a list such as 2-3,5."""
        text = _ISOLATED.read_text(encoding="ascii").strip()
        ranges = [part.partition("-") for part in text.split(",") if part]
        return {
            core for first, _, last in ranges for core in range(int(first), int(last or first) + 1)
        }


@contextmanager
def short_slices(system: Linux | None = None) -> Iterator[None]:
    """Run the block with a short time slice, if supported."""
    with ExitStack() as undo:
        with suppress(OSError, AttributeError, KeyError):  # KeyError: unknown machine
            undo.callback((system or Linux()).slice(SLICE))
        yield


@contextmanager
def real_time(system: Linux | None = None) -> Iterator[tuple[str, ...]]:
    """Run the block in real time as far as granted; yield the measures.

    Parameters
    ----------
    system : Linux, optional
        System calls; by default those of this machine.

    Yields
    ------
    tuple of str
        A sentence each for scheduling, memory, core and idle states: the granted measure, or the
        reason for its refusal with the missing right.
    """
    system = Linux() if system is None else system
    with ExitStack() as undo:
        memory = _request(undo, system.lock_memory, "memory", "locked", _MEMORY)
        idle = _request(undo, system.stay_awake, "idle states", "shallow only", _IDLE)
        core = _pin(undo, system)
        by = f"SCHED_FIFO, priority {PRIORITY}"
        schedule = partial(system.schedule, PRIORITY)
        scheduling = _request(undo, schedule, "scheduling", by, _SCHEDULING)
        yield scheduling, memory, core, idle


_SCHEDULING = (
    "raise rtprio in /etc/security/limits.conf to at least"
    f" {PRIORITY} and log in anew, or grant CAP_SYS_NICE"
)
_MEMORY = "set memlock to unlimited in /etc/security/limits.conf and log in anew"
_CORE = "reserve a core with the kernel parameter isolcpus=N"
_IDLE = "let this user write /dev/cpu_dma_latency, or limit idle states in the firmware"


def _request(
    undo: ExitStack, ask: Callable[[], Callable[[], None]], name: str, granted: str, remedy: str
) -> str:
    try:
        undo.callback(ask())
    except (OSError, AttributeError) as error:  # AttributeError: no such call
        return f"{name}: not granted ({_reason(error)}); {remedy}"
    return f"{name}: {granted}"


def _pin(undo: ExitStack, system: Linux) -> str:
    """Pin the thread to an isolated core; on a shared core other threads would block the thread."""
    try:
        isolated = sorted(system.isolated())
        if not isolated:
            shared = f"all {len(system.cores())} are shared with other programs"
            return f"core: {shared}; {_CORE}"
        undo.callback(system.pin(isolated[-1]))
    except (OSError, ValueError, AttributeError) as error:
        return f"core: not granted ({_reason(error)}); {_CORE}"
    return f"core: {isolated[-1]}, isolated, for this thread alone"


def _reason(error: Exception) -> str:
    return str((isinstance(error, OSError) and error.strerror) or error)
