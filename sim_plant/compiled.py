"""Numba's compiler as typed decorators for what runs at every step of the physics.

Floating-point rules are relaxed as far as speed needs it (fused, reordered, reciprocal) and no
further: infinities and NaN keep their meaning, since an infinite window means "off". Compiled code
is kept on disk; Numba notices that a file has changed, but not that a file it calls into has:
delete ``sim_plant/__pycache__`` after changing one of several.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar, cast

from numba import njit

if TYPE_CHECKING:
    from collections.abc import Callable

F = TypeVar("F", bound="Callable[..., object]")

RELAXED = {"reassoc", "contract", "arcp", "nsz"}
IN_ORDER = {"contract"}


def compiled(function: F) -> F:
    """Compile `function`."""
    return cast("F", njit(cache=True, fastmath=RELAXED, error_model="numpy")(function))


def inlined(function: F) -> F:
    """Compile `function` as a part of each function that calls it."""
    return cast(
        "F", njit(cache=True, fastmath=RELAXED, error_model="numpy", inline="always")(function)
    )


def in_order(function: F) -> F:
    """Compile `function` so that every operation is done as it is written, whoever calls it.

    Numba would hand on the caller's rules where a function states none.
    """
    return cast("F", njit(cache=True, fastmath=IN_ORDER, error_model="numpy")(function))
