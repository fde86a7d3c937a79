"""Command `hil doctor`: suitability of this computer for measuring, with remedies.

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
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

import typer

from hil.cli.realtime import PRIORITY
from hil.terminal.console import give, out, working

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

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
    found = (
        Judged(
            "Python", "FAIL" if r.python[:2] < PYTHON_MIN else "OK", version,
            f"install Python {least} or later",
        ),
        Judged("kernel", kernel, sockets, adapter),
        *_interfaces(r),
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


def _interfaces(r: Readings) -> Iterator[Judged]:
    if not r.interfaces:
        remedy = "plug in the adapter and load its driver; then ip link lists it"
        yield Judged("CAN interfaces", "WARN", "none; the virtual plant needs none", remedy)
    for each in r.interfaces:
        rate = "" if each.bitrate is None else f" at {each.bitrate // 1000} kbit/s"
        kind = "" if each.virtual else f" type can bitrate {each.bitrate or 1_000_000}"
        word: Word = "OK" if each.up else "WARN"
        state = "up" if each.up else "down"
        yield Judged(each.name, word, f"{state}{rate}", f"sudo ip link set {each.name} up{kind}")


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
    return Readings(
        python=tuple(sys.version_info[:3]),
        system=platform.system(),
        socketcan=socketcan,
        vcan=Path("/sys/module/vcan").exists(),
        interfaces=tuple(_can_interfaces()),
        administrator=administrator,
        priority=priority,
        resolution=time.get_clock_info("monotonic").resolution,
        folder=str(folder),
        disk=shutil.disk_usage(place).free,
        writable=os.access(place, os.W_OK),
        memory=memory,
        extras={name: find_spec(module) is not None for name, module in EXTRAS.items()},
    )


def _can_interfaces() -> Iterator[CanInterface]:
    rates: dict[str, int] = {}
    # without `ip`, or where it knows no bit rate, the rates are unknown
    with suppress(OSError, subprocess.SubprocessError, ValueError, KeyError, TypeError):
        command = [shutil.which("ip") or "", "-details", "-json", "link", "show", "type", "can"]
        done = subprocess.run(command, capture_output=True, timeout=5.0, check=True)  # noqa: S603 - no input of others
        for link in json.loads(done.stdout or b"[]"):
            rates[link["ifname"]] = link["linkinfo"]["info_data"]["bittiming"]["bitrate"]
    for entry in sorted(Path("/sys/class/net").glob("*/type")):
        if entry.read_text().strip() == CAN_TYPE:
            flags = int((entry.parent / "flags").read_text(), 16)
            name = entry.parent.name
            virtual = not (entry.parent / "device").exists()
            yield CanInterface(name, bool(flags & 1), rates.get(name), virtual)


@commands.command()
def doctor(
    folder: Annotated[
        Path,
        typer.Option(
            "--folder", help="Folder for runs; its free space and permissions are checked."
        ),
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
