"""Boot image of the guest: Debian's kernel, the modules for CAN, and an initial file system.

Packages are fetched with ``apt-get download`` and unpacked without being installed, so no root is
needed. The kernel, a static busybox, and the modules for SocketCAN and the shared file tree, in
loading order, are kept. From these files the initial file system, a cpio archive, is made at every
start within milliseconds.
"""

from __future__ import annotations

import lzma
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

MODULES = ("virtio_pci", "9pnet_virtio", "9p", "can_raw", "can_bcm", "vcan")

INIT = """#!/bin/busybox sh
for module in $(/bin/busybox cat /modules/order); do /bin/busybox insmod /modules/$module.ko; done
exec 2>&1
set -e
/bin/busybox mount -t 9p -o trans=virtio,version=9p2000.L,msize=524288,cache=loose host /host
/bin/busybox mount -t proc proc /host/proc
/bin/busybox mount -t sysfs sys /host/sys
/bin/busybox mount -t devtmpfs dev /host/dev
/bin/busybox mkdir -p /host/dev/shm
/bin/busybox mount -t tmpfs shm /host/dev/shm
/bin/busybox mount -t tmpfs run /host/run
/bin/busybox ip link set lo up
/bin/busybox ip link add vcan0 type vcan
/bin/busybox ip link set vcan0 up
for argument in $(/bin/busybox cat /host/proc/cmdline); do
  case $argument in guest.script=*) script=${argument#*=};; esac
done
set +e
/bin/busybox stty -F /host/dev/ttyS1 raw -echo
/bin/busybox chroot /host /bin/sh "$script" </host/dev/null >/host/dev/ttyS1 2>&1
/bin/busybox sync
/bin/busybox umount /host/run
/bin/busybox reboot -f
"""


class Unavailable(Exception):
    """Reason why this machine cannot run a guest, with the remedy."""


def kernel(cache: Path) -> Path:
    """Return the folder with kernel, modules and busybox, fetched if missing.

    Raises
    ------
    Unavailable
        apt is missing, or cannot fetch the packages.
    """
    folder = cache / "kernel"
    if not folder.exists():
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=cache) as scratch:
            made = _unpack(Path(scratch))
            made.rename(folder)
    return folder


def initramfs(folder: Path) -> bytes:
    """Return the initial file system as a cpio archive of format "newc"."""
    entries: list[tuple[str, int, bytes]] = [
        (name, 0o040755, b"") for name in ("bin", "modules", "host", "dev")
    ]
    entries.append(("init", 0o100755, INIT.encode()))
    entries.append(("bin/busybox", 0o100755, (folder / "busybox").read_bytes()))
    entries += [
        (f"modules/{path.name}", 0o100644, path.read_bytes())
        for path in sorted((folder / "modules").iterdir())
    ]
    return b"".join(_cpio(*entry) for entry in (*entries, ("TRAILER!!!", 0, b"")))


def _cpio(name: str, mode: int, content: bytes) -> bytes:
    fields = [0, mode, 0, 0, 1, 0, len(content), 0, 0, 0, 0, len(name) + 1, 0]
    header = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return _padded(header) + _padded(content)


def _padded(part: bytes) -> bytes:
    return part + bytes(-len(part) % 4)


def _unpack(scratch: Path) -> Path:
    depends = _apt(scratch, "apt-cache", "depends", "linux-image-amd64")
    found = re.search(r"Depends: (linux-image-\S+)", depends)
    if not found:
        raise Unavailable("apt knows no linux-image-amd64; run `apt-get update` (Debian) first")
    _apt(scratch, "apt-get", "download", found[1], "busybox-static")
    for package in scratch.glob("*.deb"):
        _apt(scratch, "dpkg", "-x", str(package), "tree")
    tree, made = scratch / "tree", scratch / "made"
    (made / "modules").mkdir(parents=True)
    shutil.copy(next(tree.glob("boot/vmlinuz-*")), made / "vmlinuz")
    shutil.copy(next(tree.glob("**/bin/busybox")), made / "busybox")
    files = {_module_name(path): path for path in tree.glob("**/lib/modules/**/*.ko*")}
    order: list[str] = []
    for name in MODULES:
        _add_module(name, files, order, made / "modules")
    (made / "modules/order").write_text("\n".join(order))
    return made


def _add_module(name: str, files: dict[str, Path], order: list[str], target: Path) -> None:
    """Keep a module after its dependencies; modules built into the kernel have no file."""
    if name in order or name not in files:
        return
    content = files[name].read_bytes()
    if files[name].suffix == ".xz":
        content = lzma.decompress(content)
    stated = re.search(rb"\0depends=([^\0]*)\0", content)
    for other in stated[1].decode().split(",") if stated else ():
        _add_module(other.replace("-", "_"), files, order, target)
    (target / f"{name}.ko").write_bytes(content)
    order.append(name)


def _module_name(path: Path) -> str:
    return path.name.partition(".")[0].replace("-", "_")


def _apt(folder: Path, *command: str) -> str:
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env={**os.environ, "LC_ALL": "C"},
            capture_output=True,
            text=True,
            check=True,
        )
    except FileNotFoundError as error:
        raise Unavailable(f"{command[0]} is missing; Debian's packages cannot be had") from error
    except subprocess.CalledProcessError as error:
        reasons = error.stderr.strip().splitlines() or ["it failed without stating a reason"]
        raise Unavailable(f"{' '.join(command)}: {reasons[-1]}") from error
    return done.stdout
