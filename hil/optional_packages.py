"""Packages that come with an extra, and the message where one is not installed."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def remedy(extra: str) -> str:
    """Return the command that installs what comes with an extra."""
    return f"pip install 'canopen-robot-identification[{extra}]'"


@contextmanager
def needed_for(what: Path | str, extra: str = "recordings") -> Iterator[None]:
    """Raise a package that is not there as a `FileError` with its remedy.

    Parameters
    ----------
    what : Path or str
        File or option that needs it, for the message.
    extra : str
        That it comes with.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise FileError(
            f"{what}: needs the package {package}, which is not installed: {remedy(extra)}"
        ) from error
