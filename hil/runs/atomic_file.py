"""Atomic writing of files and folders, and locks.

Content is written to a ``.part`` file beside its final place, flushed to the disk and renamed, and
the folder's entry is flushed too: neither a kill nor a power cut leaves half a file under the real
name.

A folder may come from a stranger, with symbolic links to files of the user. So a part has an
unpredictable name and is always a new file, and a link under the final name is replaced, not
followed. Folders within such a folder are made or checked by `own_folder`. Paths on the command
line are the user's choice.

A folder of many files that belong together is made in the same way, by `whole_folder`.

At most one process measures into a run folder, and at most one commands the drives of a bus. Two
measuring processes would remove each other's files; settings restored during a session would remove
limits and watchdogs from powered axes. The lock is the kernel's, on the folder itself or on a
permanent file, and ends with the process. Systems without kernel locks have no protection.
"""

from __future__ import annotations

import os
import re
import secrets
import shutil
import time
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from pathlib import Path


try:
    import fcntl
except ImportError:  # no Unix
    fcntl = None  # type: ignore[assignment]


PART = ".part"
ABANDONED = 60.0
"""Minimum age of another folder's part before removal, locked or not [s]."""
_FRESH = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
_ENDING = re.compile(rf"(\.[0-9a-f]{{8}})?{re.escape(PART)}$")


def write_file(path: Path, content: bytes | memoryview) -> None:
    """Write `content` to `path`, completely or not at all.

    Raises
    ------
    FileError
        Disk full, read-only, folder gone.
    """
    part = path.with_name(f"{path.name}.{secrets.token_hex(4)}{PART}")
    with file_errors(path, "written"):
        try:
            with os.fdopen(os.open(part, _FRESH, 0o666), "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except BaseException:  # an incomplete part only fills the disk
            with suppress(OSError):
                part.unlink()
            raise
        _flush_folder(path.parent)


@contextmanager
def whole_folder(output: Path) -> Iterator[Path]:
    """Yield a new folder beside `output`, renamed at the end or removed.

    Missing parent folders are made, and removed on failure. An empty folder at `output` is
    replaced. Parts left by a killed process, of this folder or of others beside it, are removed;
    active processes hold a lock on their part.

    Raises
    ------
    FileError
        The folder cannot be made.
    """
    missing = [folder for folder in output.parents if not folder.exists()]
    part = output.with_name(f".{output.name}.{secrets.token_hex(4)}{PART}")
    try:
        new_folder(part)
        _remove_abandoned(output, part)
        with _held(part, os.O_RDONLY, f"{part}: is in use"):
            yield part
            with file_errors(output, "made"):
                part.rename(output)
                _flush_folder(output.parent)
    except BaseException:
        shutil.rmtree(part, ignore_errors=True)
        with suppress(OSError):  # another process has put something there meanwhile
            for folder in missing:
                folder.rmdir()
        raise


def new_folder(path: Path) -> None:
    """Make a folder and missing parents, and flush the entries to the disk.

    Raises
    ------
    FileError
        The folder cannot be made.
    """
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    with file_errors(path, "made"):
        path.mkdir(parents=True, exist_ok=True)
        for folder in made:
            _flush_folder(folder.parent)


def _remove_abandoned(output: Path, own: Path) -> None:
    """Remove parts of folders without a living process; none on systems without locks.

    A part of another folder may be new and not locked yet.
    """
    hexadecimal = "[0-9a-f]" * 8
    same = f".{output.name}."
    for part in output.parent.glob(f".*.{hexadecimal}{PART}"):
        if fcntl is None or part == own or part.is_symlink():
            continue
        with suppress(OSError):
            age = time.time() - part.stat().st_mtime
            if age < ABANDONED and not part.name.startswith(same):
                continue
            handle = os.open(part, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(part, ignore_errors=True)
            finally:
                os.close(handle)


@contextmanager
def new_file(path: Path) -> Iterator[IO[bytes]]:
    """Yield a new file of a `whole_folder` for writing, flushed to the disk at the end.

    Raises
    ------
    FileError
        The file already exists, or cannot be written.
    """
    with file_errors(path, "written"), os.fdopen(os.open(path, _FRESH, 0o666), "wb") as file:
        yield file
        file.flush()
        os.fsync(file.fileno())


def whole_name(name: str) -> str:
    """Return the final name of a file from the name of a part."""
    return _ENDING.sub("", name)


def own_folder(path: Path) -> None:
    """Make a folder within another one, if missing.

    Raises
    ------
    FileError
        The folder is a symbolic link, or cannot be made.
    """
    refuse_link(path)
    with file_errors(path, "made"):
        path.mkdir(exist_ok=True)


def refuse_link(path: Path) -> None:
    """Refuse a folder that is a symbolic link, since writing would lead elsewhere.

    Raises
    ------
    FileError
        The folder is a symbolic link.
    """
    if path.is_symlink():
        raise FileError(
            f"{path}: is a symbolic link to {path.readlink()}; links are not followed: replace "
            "the link by a folder, or move the whole parent folder instead"
        )


@contextmanager
def file_errors(path: Path, what: str) -> Iterator[None]:
    """Raise an error of the file system as a `FileError` that names file and reason."""
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


def locked(path: Path) -> AbstractContextManager[None]:
    """Hold the lock of a run folder.

    Raises
    ------
    FileError
        Another process holds the lock.
    """
    return _held(
        path,
        os.O_RDONLY,
        f"{path}: another process measures into this folder; wait for its end, or choose another "
        "folder with -o",
    )


def locked_bus(path: Path, bus: str) -> AbstractContextManager[None]:
    """Hold the lock of a bus: a file, made if missing.

    Raises
    ------
    FileError
        Another process holds the lock, or the file cannot be made.
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
        except OSError:  # a file system without locks, such as some network file systems
            pass
        yield
    finally:
        os.close(handle)
