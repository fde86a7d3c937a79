"""One process measures into a run folder, and one commands the drives of a bus, at a time.

Two that measure would take each other's files away; settings put back beside a session would take
limits and watchdogs from axes with power. The lock is the kernel's, on the folder itself or on a
file that stays. It goes with the process, however that ends. A system without such locks goes
without.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError
from hil.runs.atomic_file import file_errors

try:
    import fcntl
except ImportError:  # no Unix
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path


def locked(path: Path) -> AbstractContextManager[None]:
    """Hold the lock of a run folder.

    Raises
    ------
    FileError
        Another process holds it.
    """
    return _held(
        path,
        os.O_RDONLY,
        f"{path}: another process measures into it now; wait for its end, or choose another folder"
        " with -o",
    )


def locked_bus(path: Path, bus: str) -> AbstractContextManager[None]:
    """Hold the lock of a bus, a file that is made where it is missing.

    Raises
    ------
    FileError
        Another process holds it, or the file cannot be made.
    """
    return _held(
        path,
        os.O_RDONLY | os.O_CREAT,
        f"{bus}: another process commands the drives of this bus now, and holds {path}; wait for"
        " its end, or stop it",
    )


@contextmanager
def _held(path: Path, flags: int, refusal: str) -> Iterator[None]:
    if fcntl is None:
        yield
        return
    with file_errors(path, "locked"):
        handle = os.open(path, flags, 0o600)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FileError(refusal) from error
        except OSError:  # a file system without locks, as some networks' are
            pass
        yield
    finally:
        os.close(handle)
