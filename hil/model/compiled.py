"""Numba's compiler as a typed decorator: compiled at first call, kept on disk, no fast-math.

Without fast-math the same expression gives the same bits wherever it stands, so that models built
on one recursion agree to rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, cast

from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

F = TypeVar("F", bound="Callable[..., object]")


def compiled(function: F) -> F:
    """Compile `function` in Numba's nopython mode."""
    return cast("F", njit(cache=True, error_model="numpy")(function))
