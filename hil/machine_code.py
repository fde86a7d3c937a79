"""Functions in C, compiled at installation if a compiler is found, and called by `ctypes`.

Without a compiler, equivalent functions in Python give the same results.
"""

from __future__ import annotations

import ctypes
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
    raise ModuleNotFoundError(
        f"{name} is not compiled: no C compiler was found at installation; "
        "install a compiler, then this package again"
    )


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """Return the address of a contiguous array."""
    return ctypes.c_void_p(array.ctypes.data)
