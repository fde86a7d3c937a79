"""One process measures into a run folder at a time: two would take each other's files away.

The lock is the kernel's, on the folder itself. It leaves no file behind and goes with the process,
however that ends. A system without such locks goes without.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING

from drivers.yaml_file import FileError

try:
    import fcntl
except ImportError:  # no Unix
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock of a run folder.

    Raises
    ------
    FileError
        Another process holds it.
    """
    if fcntl is None:
        yield
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise FileError(
                f"{path}: another process measures into it now; wait for its end, or choose"
                " another folder with -o"
            ) from error
        except OSError:  # a file system without locks, as some networks' are
            pass
        yield
    finally:
        os.close(handle)
