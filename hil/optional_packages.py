"""Optional packages by extra, with an error message if a package is missing."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


_PACKAGES = {"foxglove": "foxglove-sdk", "matio": "mat-io"}
"""Packages by the name of their module, if the names differ."""


def remedy(extra: str, package: str) -> str:
    """Return the commands for installing a package, or an extra.

    The project itself need not be in a package index: the first command installs the package alone,
    the second the extra of a checkout.
    """
    return f"pip install {package}; or, in a checkout, pip install '.[{extra}]'"


@contextmanager
def needed_for(what: Path | str, extra: str = "recordings") -> Iterator[None]:
    """Raise a `FileError` with a remedy for a missing package.

    Parameters
    ----------
    what : Path or str
        File or option that needs the package, for the message.
    extra : str
        Extra that installs the package.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        module = str(error.name).partition(".")[0]
        package = _PACKAGES.get(module, module)
        raise FileError(
            f"{what}: needs the package {package}, which is not installed: {remedy(extra, package)}"
        ) from error
