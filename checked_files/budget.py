"""Budget of memory and disk for a foreign file.

A small file can declare, or unpack to, any size. A reader asks here before it reads or unpacks.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from pathlib import Path

LIMIT = "HIL_READ_LIMIT"
"""Environment variable that raises the budget of every file [GB]."""
BASE, SHARE = 200_000_000, 4
"""Budget in bytes, and as a multiple of the file: text of two characters a cell becomes four times
as large as numbers of eight bytes, and 200 MB are an hour of seven joints at 300 Hz."""
CHECKED = 100
"""Items between two checks of a budget: columns of 800 bytes exceed it by 80 kB at most."""
PASSED = 5
"""Budget of data read piece by piece and not kept, as a multiple of the file: a bound on time,
since zlib unpacks up to 1032 times as much. 1 GB of text takes 3 s in lines of 100 characters, 44 s
in lines of two (measured, processor time).
"""


def allowed(path: Path, base: int | None = None) -> int:
    """Return the budget of a file, or of the files in a folder [bytes]."""
    try:
        raised = float(os.environ.get(LIMIT, "0"))
    except ValueError:
        raised = 0.0
    files = [path, *(path.iterdir() if path.is_dir() else ())]
    size: int = sum(each.stat().st_size for each in files if each.is_file())
    stated = int(raised * 1e9) if 0 < raised < 1e9 else 0
    return max(stated, (BASE if base is None else base) + SHARE * size)


def refuse_beyond(
    path: Path, size: int, what: str, base: int | None = None, times: int = 1
) -> None:
    """Refuse a file if `what` would exceed the budget: `base` [bytes], and 4 times the file.

    Only data held at one time count, in memory or on the disk; `times` is `PASSED` for data that
    are read and not kept.

    Raises
    ------
    FileError
        With size, bound and remedy.
    """
    base = BASE if base is None else base
    if size > times * base and size > (most := times * allowed(path, base)):
        raise FileError(
            f"{path}: {what} would take {_megabytes(size)} MB, at most {_megabytes(most)} MB "
            f"allowed ({_megabytes(times * base)} MB and {times * SHARE} times the file); if you "
            f"trust the file, set {LIMIT}={-(-size // (times * 1_000_000_000))} in the environment "
            "[GB]"
        )


def exceeded(path: Path, what: str) -> FileError:
    """Return the error about `what` beyond the budget of a file."""
    most = allowed(path)
    return FileError(
        f"{path}: {what} takes more than {_megabytes(most)} MB (200 MB and 4 times the file); if"
        f" you trust the file, set {LIMIT}={-(-2 * most // 1_000_000_000)} in the environment [GB]"
    )


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.4g}"
