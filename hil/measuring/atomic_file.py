"""Files that are either there and whole, or not there.

Content is written beside its place as ``.part``, flushed to the disk, renamed, and the folder's
entry flushed too: neither a kill nor a power cut leaves half a file under the real name.
"""

from __future__ import annotations

import os
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from drivers.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PART = ".part"


def write_file(path: Path, content: bytes) -> None:
    """Write `content` to `path`, whole or not at all.

    Raises
    ------
    FileError
        Disk full, read-only, folder gone.
    """
    part = path.with_name(path.name + PART)
    with operator_told(path, "written"):
        try:
            with part.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except OSError:
            with suppress(OSError):  # what does not fit only fills the disk
                part.unlink()
            raise
        _flush_folder(path.parent)


@contextmanager
def operator_told(path: Path, what: str) -> Iterator[None]:
    """Turn an error of the file system into a `FileError` that names file and reason."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise FileError(f"{path}: cannot be {what}: {reason}") from error


def _flush_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
