"""Packages that only some formats need, and the message where one is not installed."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

REMEDY = "pip install 'canopen-robot-identification[recordings]'"


@contextmanager
def needed_for(path: Path) -> Iterator[None]:
    """Raise a package that is not there as a `FileError` with its remedy."""
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise FileError(
            f"{path}: needs the package {package}, which is not installed: {REMEDY}"
        ) from error
