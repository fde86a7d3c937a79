"""Command `hil doctor`: suitability of this computer for measuring, with remedies.

`Readings` holds the system's data, so that other computers can be described; `read_computer` reads
the running one and changes nothing.

`real_time` executes a command in real time as far as granted: scheduling class, memory, core, idle
states. SYNC on the wall clock is as regular as this process is woken up. A normal process shares
its core with all others, may be moved between cores, may have its memory paged out, and its core
may sleep; each of these sometimes costs milliseconds. `real_time` applies four measures to the
calling thread, as far as they are granted, and yields a hint for each refused measure. On leaving,
everything is restored. Threads started meanwhile, such as the one that writes files, keep the
normal scheduling class.

The priority is below that of the kernel's own threads, among them those of interrupts: frames are
received and sent before the thread that waits for them runs.

Inside `short_slices` a normal thread is woken up sooner, without any rights. Linux first runs the
thread whose slice ends first in virtual time (EEVDF). A short slice ends soon, and from Linux 6.12
on a thread may request one. Its share of the processor stays the same.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import shutil
import socket
import struct
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer
from typer import Option

from hil.terminal.console import give, out, working

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping


commands = typer.Typer()
Word = Literal["OK", "WARN", "FAIL"]
PYTHON_MIN = (3, 11)
DISK, MEMORY = (100e6, 2e9), (300e6, 1e9)
"""Free space below which a run, or an identification, fails, and may fail if long [bytes]."""
CAN_TYPE = "280"
STYLES = {"OK": "green", "WARN": "yellow", "FAIL": "bold red"}
EXTRAS = {
    "dask": "distributed", "fleet": "duckdb", "mujoco": "mujoco", "pandas": "pandas",
    "recordings": "pyarrow",
}  # fmt: skip
"""Optional extras of the installation, with a module from each."""


@dataclass(frozen=True, slots=True)
class CanInterface:
    """CAN interface of the kernel; `bitrate` [bit/s] is None if unset or unreadable."""

    name: str
    up: bool
    bitrate: int | None
    virtual: bool = False


@dataclass(frozen=True, slots=True)
class Readings:
    """System data relevant for measuring.

    Attributes
    ----------
    python : tuple of int
        Version of Python.
    system : str
        Name of the operating system.
    socketcan, vcan : bool
        True if the kernel opens CAN sockets, and has the module of virtual interfaces.
    administrator : bool
        True if this user may set up interfaces.
    priority : int
        Highest real-time priority permitted to this user; 0 for none.
    resolution : float
        Resolution of the clock [s].
    folder : str
        Folder with the checked free space.
    disk, memory : float
        Free disk space and memory [bytes].
    writable : bool
        True if the folder is writable.
    extras : mapping of str to bool
        True for each installed optional package, by name.
    """

    python: tuple[int, ...]
    system: str
    socketcan: bool
    vcan: bool
    interfaces: tuple[CanInterface, ...]
    administrator: bool
    priority: int
    resolution: float
    folder: str
    disk: float
    writable: bool
    memory: float
    extras: Mapping[str, bool]


class Judged(NamedTuple):
    """Result of a check, with remedy."""

    point: str
    word: Word
    found: str
    remedy: str = ""


def judge(r: Readings) -> tuple[Judged, ...]:
    """Judge the readings of a system; remedies are for checks that find a problem."""
    version, least = (".".join(map(str, each)) for each in (r.python, PYTHON_MIN))
    kernel: Word = "OK" if r.socketcan else "WARN"
    sockets = "no CAN sockets; the virtual plant needs none"
    adapter = "use an adapter with a python-can interface"
    if r.socketcan:
        sockets = (
            "can and vcan" if r.vcan else "can; no vcan (needed only for tests without hardware)"
        )
    elif r.system == "Linux":
        adapter = f"sudo modprobe can_raw, or {adapter}"
    else:
        sockets = f"{r.system} has no SocketCAN"
    rights = "this user has no permission to set up interfaces"
    if all_up := bool(r.interfaces) and all(each.up for each in r.interfaces):
        rights = "interfaces are up"
    if r.administrator:
        rights = "interfaces can be set up"
    priority = "" if r.priority >= PRIORITY else f", and --realtime asks for {PRIORITY}"
    # a coarser clock than 0.1 ms cannot pace SYNC
    clock: Word = "FAIL" if r.resolution > 1e-4 else "OK"
    disk = f"{r.folder} cannot be written to", "run in another folder"
    interfaces = []
    if not r.interfaces:
        remedy = "plug in the adapter and load its driver; then ip link lists it"
        none = "none; the virtual plant needs none"
        interfaces.append(Judged("CAN interfaces", "WARN", none, remedy))
    for each in r.interfaces:
        rate = "" if each.bitrate is None else f" at {each.bitrate // 1000} kbit/s"
        kind = "" if each.virtual else f" type can bitrate {each.bitrate or 1_000_000}"
        state = f"{'up' if each.up else 'down'}{rate}"
        remedy = f"sudo ip link set {each.name} up{kind}"
        interfaces.append(Judged(each.name, "OK" if each.up else "WARN", state, remedy))
    found = (
        Judged(
            "Python", "FAIL" if r.python[:2] < PYTHON_MIN else "OK", version,
            f"install Python {least} or later",
        ),
        Judged("kernel", kernel, sockets, adapter),
        *interfaces,
        Judged(
            "rights", "OK" if r.administrator or all_up else "WARN", rights,
            "bring the interface up with sudo or as administrator",
        ),
        Judged(
            "real-time priority", "WARN" if priority else "OK", f"up to {r.priority}{priority}",
            f"add '@realtime - rtprio {PRIORITY}' to /etc/security/limits.conf, and log in anew",
        ),
        Judged(
            "clock", clock, f"resolution {1e9 * r.resolution:.0f} ns",
            "use a kernel with high-resolution timers; SYNC on a real bus needs them",
        ),
        _amount("disk", r.disk, DISK, f"free up space on the disk of {r.folder}")
        if r.writable else Judged("disk", "FAIL", *disk),
        _amount("memory", r.memory, MEMORY, "end other programs"),
        *(Judged(f"extra {name}", "OK", "installed" if there else "not installed; optional")
          for name, there in r.extras.items()),
    )  # fmt: skip
    return tuple(each._replace(remedy="") if each.word == "OK" else each for each in found)


def _amount(point: str, free: float, bounds: tuple[float, float], remedy: str) -> Judged:
    (least, ample), found = bounds, f"{free / 1e9:.1f} GB free"
    if free >= ample:
        return Judged(point, "OK", found)
    needed = f"{found}, of {ample / 1e9:.1f} GB that a long run may take"
    return Judged(point, "WARN" if free >= least else "FAIL", needed, remedy)


def read_computer(folder: Path) -> Readings:
    """Read the data of this computer, with `folder` for runs; nothing is changed."""
    place = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    socketcan, administrator = False, hasattr(os, "geteuid") and os.geteuid() == 0
    with suppress(AttributeError, OSError):
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
        socketcan = True
    priority = 99 if administrator else 0
    with suppress(ImportError):
        import resource

        priority = max(resource.getrlimit(resource.RLIMIT_RTPRIO)[0], priority)
    memory = float("inf")
    with suppress(OSError, StopIteration, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        memory = next(1024.0 * int(line.split()[1]) for line in lines if "MemAvailable" in line)
    interfaces, rates = [], dict[str, int]()
    # without `ip`, or where it knows no bit rate, the rates are unknown
    with suppress(OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError):
        command = [shutil.which("ip") or "", "-details", "-json", "link", "show", "type", "can"]
        done = subprocess.run(command, capture_output=True, timeout=5.0, check=True)  # noqa: S603 - no input of others
        for link in json.loads(done.stdout or b"[]"):
            rates[link["ifname"]] = link["linkinfo"]["info_data"]["bittiming"]["bitrate"]
    for entry in sorted(Path("/sys/class/net").glob("*/type")):
        if entry.read_text().strip() == CAN_TYPE:
            up = bool(int((entry.parent / "flags").read_text(), 16) & 1)
            virtual, name = not (entry.parent / "device").exists(), entry.parent.name
            interfaces.append(CanInterface(name, up, rates.get(name), virtual))
    return Readings(
        python=tuple(sys.version_info[:3]),
        system=platform.system(),
        socketcan=socketcan,
        vcan=Path("/sys/module/vcan").exists(),
        interfaces=tuple(interfaces),
        administrator=administrator,
        priority=priority,
        resolution=time.get_clock_info("monotonic").resolution,
        folder=str(folder),
        disk=shutil.disk_usage(place).free,
        writable=os.access(place, os.W_OK),
        memory=memory,
        extras={name: find_spec(module) is not None for name, module in EXTRAS.items()},
    )


@commands.command()
def doctor(
    folder: Annotated[
        Path,
        Option("--folder", help="Folder for runs; its free space and permissions are checked."),
    ] = Path(),
) -> None:
    """Check this computer: Python, CAN, rights, clock, disk.

    Exit status 1 where a check fails.
    """
    with working("examining this computer"):
        from rich.text import Text

        from hil.show.terminal import show_beside

        points = judge(read_computer(folder))
    give(points=[each._asdict() for each in points])
    width = max(len(each.point) for each in points)
    for each in points:
        remedy = f"; {each.remedy}" if each.remedy else ""
        head = Text(f"{each.word:4}  {each.point}", style=STYLES[each.word])
        show_beside(head, f"{each.found}{remedy}", width + 8, out)
    if any(each.word == "FAIL" for each in points):
        raise typer.Exit(1)


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
