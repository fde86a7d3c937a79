"""Run a command with a ``vcan0``, in a QEMU guest with Debian's kernel.

::

    python tools/can_guest.py [--timeout SECONDS] COMMAND [ARGUMENT ...]

For machines whose kernel has no CAN. The guest sees this machine's whole file tree, so that the
same virtual environment and checkout run inside, in the same folder and with the same environment.
Only temporary files stay in the guest, in memory: shared folders cannot hold deleted open files.
Output and exit status are those of the command. Needs ``qemu-system-x86_64``; kernel and busybox
are fetched once from Debian's packages, into ``$XDG_CACHE_HOME/can-guest``. Without hardware
virtualisation the guest is some 10 to 20 times slower than this machine.

Exit status 69: this machine cannot run a guest. 70: the guest died. 124: out of time.
"""

from __future__ import annotations

import argparse
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from guest_image import Unavailable, initramfs, kernel

QEMU = "qemu-system-x86_64"
NO_GUEST, DIED, OUT_OF_TIME = 69, 70, 124


def main() -> int:
    """Run the command; return the exit status of the command or of this module."""
    parser = argparse.ArgumentParser(description="Run a command in a QEMU guest that has a vcan0.")
    parser.add_argument("--timeout", type=float, help="give the guest so long [s]")
    parser.add_argument("command", nargs=argparse.REMAINDER, help="and its arguments")
    given = parser.parse_args()
    if not given.command:
        parser.error("a command is needed")
    try:
        return run(given.command, given.timeout)
    except Unavailable as error:
        sys.stderr.write(f"can_guest: {error}\n")
        return NO_GUEST


def run(command: list[str], timeout: float | None) -> int:
    """Boot the guest, run the command in it, and return its exit status.

    Raises
    ------
    Unavailable
        This machine cannot run a guest, or the guest did not boot.
    """
    if platform.machine() != "x86_64" or not shutil.which(QEMU):
        raise Unavailable(f"{QEMU} is missing; install it (Debian: apt install qemu-system-x86)")
    folder = kernel(_cache())
    with tempfile.TemporaryDirectory(dir=_cache()) as scratch:
        shared = Path(scratch)
        (shared / "initramfs").write_bytes(initramfs(folder))
        (shared / "script").write_text(_script(command, shared))
        try:
            subprocess.run(
                _qemu(folder, shared), stdin=subprocess.DEVNULL, timeout=timeout, check=False
            )
        except subprocess.TimeoutExpired:
            sys.stderr.write(f"can_guest: stopped after {timeout:g} s\n")
            return OUT_OF_TIME
        return _status(shared)


def _cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "can-guest"


def _script(command: list[str], shared: Path) -> str:
    """Return the script for the guest's shell: the command in this folder and environment."""
    exports = [
        f"export {name}={shlex.quote(value)}"
        for name, value in os.environ.items()
        if name.isidentifier()
    ]
    lines = [
        *exports,
        "export TMPDIR=/run",
        f"echo started > {shlex.quote(str(shared / 'status'))}",
        f"cd {shlex.quote(str(Path.cwd()))}",
        shlex.join(command),
        f"echo $? > {shlex.quote(str(shared / 'status'))}",
    ]
    return "\n".join(lines) + "\n"


def _qemu(folder: Path, shared: Path) -> list[str]:
    accelerator = "kvm" if _virtualises() else "tcg,thread=multi"
    append = f"console=ttyS0 panic=-1 quiet mitigations=off guest.script={shared / 'script'}"
    return [
        *(QEMU, "-accel", accelerator, "-cpu", "max"),
        *("-smp", "2", "-m", "3072", "-no-reboot", "-nodefaults", "-nographic"),
        *("-kernel", str(folder / "vmlinuz"), "-initrd", str(shared / "initramfs")),
        *("-append", append),
        *("-virtfs", "local,path=/,mount_tag=host,security_model=none,multidevs=remap"),
        *("-serial", f"file:{shared / 'console'}", "-serial", "stdio"),
    ]


def _virtualises() -> bool:
    """Return True if KVM works; /dev/kvm may exist without support by the processor."""
    flags = Path("/proc/cpuinfo").read_text().split()
    return bool({"vmx", "svm"} & set(flags)) and os.access("/dev/kvm", os.R_OK | os.W_OK)


def _status(shared: Path) -> int:
    status = shared / "status"
    written = status.read_text().strip() if status.exists() else ""
    if written.isdigit():
        return int(written)
    console = (shared / "console").read_text(errors="replace") if not written else ""
    last = "; ".join(console.strip().splitlines()[-3:]) or "nothing"
    if not written:
        raise Unavailable(f"the guest did not boot; its console's last lines: {last}")
    sys.stderr.write("can_guest: the guest died before the command ended\n")
    return DIED


if __name__ == "__main__":
    sys.exit(main())
