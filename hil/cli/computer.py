"""Suitability of the computer for measuring: single checks with verdict and remedy.

`Readings` holds the system's data, so that other computers can be described; `read_computer` reads
the running one and changes nothing.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hil.cli.realtime import PRIORITY

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Word = Literal["OK", "WARN", "FAIL"]
PYTHON_MIN = (3, 11)
DISK_LEAST, DISK_AMPLE = 100e6, 2e9
"""Free disk space below which a run fails, and below which a long run may fail [bytes]."""
MEMORY_LEAST, MEMORY_AMPLE = 300e6, 1e9
"""Free memory below which an identification fails, and below which one may fail [bytes]."""
_CAN_TYPE = "280"
_NET = Path("/sys/class/net")


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
    interfaces : tuple of CanInterface
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


@dataclass(frozen=True, slots=True)
class Judged:
    """Result of a check, with remedy."""

    point: str
    word: Word
    found: str
    remedy: str = ""


def judge(readings: Readings) -> tuple[Judged, ...]:
    """Judge the readings of a system."""
    return (
        _python(readings),
        _kernel(readings),
        *_interfaces(readings),
        _rights(readings),
        _priority(readings),
        _clock(readings),
        _disk(readings),
        _memory(readings),
        *_extras(readings),
    )


def _python(r: Readings) -> Judged:
    version, least = (".".join(map(str, each)) for each in (r.python, PYTHON_MIN))
    if r.python[:2] < PYTHON_MIN:
        return Judged("Python", "FAIL", version, f"install Python {least} or later")
    return Judged("Python", "OK", version)


def _kernel(r: Readings) -> Judged:
    if r.socketcan:
        found = (
            "can and vcan" if r.vcan else ("can; no vcan (needed only for tests without hardware)")
        )
        return Judged("kernel", "OK", found)
    if r.system != "Linux":
        found = f"{r.system} has no SocketCAN"
        return Judged("kernel", "WARN", found, "use an adapter with a python-can interface")
    return Judged(
        "kernel",
        "WARN",
        "no CAN sockets; the virtual plant needs none",
        "sudo modprobe can_raw, or use an adapter with a python-can interface",
    )


def _interfaces(r: Readings) -> Iterator[Judged]:
    if not r.interfaces:
        remedy = "plug in the adapter and load its driver; then ip link lists it"
        yield Judged("CAN interfaces", "WARN", "none; the virtual plant needs none", remedy)
    for each in r.interfaces:
        yield _interface(each)


def _interface(each: CanInterface) -> Judged:
    rate = "" if each.bitrate is None else f" at {each.bitrate // 1000} kbit/s"
    if each.up:
        return Judged(each.name, "OK", f"up{rate}")
    kind = "" if each.virtual else f" type can bitrate {each.bitrate or 1_000_000}"
    return Judged(each.name, "WARN", f"down{rate}", f"sudo ip link set {each.name} up{kind}")


def _rights(r: Readings) -> Judged:
    if r.administrator:
        return Judged("rights", "OK", "interfaces can be set up")
    if r.interfaces and all(each.up for each in r.interfaces):
        return Judged("rights", "OK", "interfaces are up")
    found = "this user has no permission to set up interfaces"
    return Judged("rights", "WARN", found, "bring the interface up with sudo or as administrator")


def _priority(r: Readings) -> Judged:
    if r.priority >= PRIORITY:
        return Judged("real-time priority", "OK", f"up to {r.priority}")
    found = f"up to {r.priority}, and --realtime asks for {PRIORITY}"
    remedy = f"add '@realtime - rtprio {PRIORITY}' to /etc/security/limits.conf, and log in anew"
    return Judged("real-time priority", "WARN", found, remedy)


def _clock(r: Readings) -> Judged:
    found = f"resolution {1e9 * r.resolution:.0f} ns"
    if r.resolution > 1e-4:  # a coarser clock cannot pace SYNC [s]
        remedy = "use a kernel with high-resolution timers; SYNC on a real bus needs them"
        return Judged("clock", "FAIL", found, remedy)
    return Judged("clock", "OK", found)


def _disk(r: Readings) -> Judged:
    if not r.writable:
        return Judged("disk", "FAIL", f"{r.folder} cannot be written to", "run in another folder")
    return _amount(
        "disk", r.disk, (DISK_LEAST, DISK_AMPLE), f"free up space on the disk of {r.folder}"
    )


def _memory(r: Readings) -> Judged:
    return _amount("memory", r.memory, (MEMORY_LEAST, MEMORY_AMPLE), "end other programs")


def _amount(point: str, free: float, bounds: tuple[float, float], remedy: str) -> Judged:
    least, ample = bounds
    found = f"{free / 1e9:.1f} GB free"
    if free >= ample:
        return Judged(point, "OK", found)
    needed = f"{found}, of {ample / 1e9:.1f} GB that a long run may take"
    return Judged(point, "WARN" if free >= least else "FAIL", needed, remedy)


def _extras(r: Readings) -> Iterator[Judged]:
    for name, there in r.extras.items():
        yield Judged(f"extra {name}", "OK", "installed" if there else "not installed; optional")


def read_computer(folder: Path, extras: Mapping[str, str]) -> Readings:
    """Read the data of this computer; nothing is changed.

    Parameters
    ----------
    folder : Path
        Folder for runs.
    extras : mapping of str to str
        Names of optional extras, with a module from each.
    """
    place = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    return Readings(
        python=tuple(sys.version_info[:3]),
        system=platform.system(),
        socketcan=_opens_can(),
        vcan=Path("/sys/module/vcan").exists(),
        interfaces=tuple(_can_interfaces()),
        administrator=hasattr(os, "geteuid") and os.geteuid() == 0,
        priority=_highest_priority(),
        resolution=time.get_clock_info("monotonic").resolution,
        folder=str(folder),
        disk=shutil.disk_usage(place).free,
        writable=os.access(place, os.W_OK),
        memory=_free_memory(),
        extras={name: find_spec(module) is not None for name, module in extras.items()},
    )


def _opens_can() -> bool:
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except (AttributeError, OSError):
        return False
    return True


def _can_interfaces() -> Iterator[CanInterface]:
    rates = _bit_rates()
    for entry in sorted(_NET.glob("*/type")):
        if entry.read_text().strip() == _CAN_TYPE:
            flags = int((entry.parent / "flags").read_text(), 16)
            name = entry.parent.name
            virtual = not (entry.parent / "device").exists()
            yield CanInterface(name, bool(flags & 1), rates.get(name), virtual)


def _bit_rates() -> dict[str, int]:
    ip = shutil.which("ip")
    if ip is None:
        return {}
    command = [ip, "-details", "-json", "link", "show", "type", "can"]
    try:
        done = subprocess.run(command, capture_output=True, timeout=5.0, check=True)  # noqa: S603 - no input of others
        links = json.loads(done.stdout or b"[]")
        return {
            link["ifname"]: link["linkinfo"]["info_data"]["bittiming"]["bitrate"] for link in links
        }
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError):
        return {}


def _highest_priority() -> int:
    try:
        import resource
    except ImportError:
        return 0
    if os.geteuid() == 0:
        return 99
    return max(resource.getrlimit(resource.RLIMIT_RTPRIO)[0], 0)


def _free_memory() -> float:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if "MemAvailable" in line)
    except (OSError, StopIteration, ValueError):
        return float("inf")
