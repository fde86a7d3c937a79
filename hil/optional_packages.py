"""Optional packages by extra, with an error message if a package is missing.

Functions in C, compiled at installation if a compiler is found, and called by `ctypes`.

Without a compiler, equivalent functions in Python give the same results.
"""

from __future__ import annotations

import ctypes
from contextlib import contextmanager
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import TYPE_CHECKING, Any

from checked_files.yaml_file import FileError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray


def library(module: str, name: str) -> ctypes.CDLL:
    """Load a library next to a module's file.

    Raises
    ------
    ModuleNotFoundError
        No C compiler was available at installation.
    """
    for suffix in EXTENSION_SUFFIXES:
        built = Path(module).with_name(f"{name}{suffix}")
        if built.exists():
            return ctypes.CDLL(str(built))
    raise ModuleNotFoundError(f"{name} is not compiled: no C compiler was there at installation")


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of a contiguous array."""
    return ctypes.c_void_p(array.ctypes.data)


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
        File or option that needs it, for the message.
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
