"""Numba's compiler as typed decorators for the functions of every physics step.

Floating-point rules are relaxed as far as speed needs it (fused, reordered, reciprocal) and no
further: infinities and NaN keep their meaning, since an infinite window means "off".

Compiled code is kept on disk in Numba's cache folder. Numba checks the file of a function alone,
but callees and constants of other files are compiled into it. So the file names contain a digest of
the sources of the function's module and of its direct and indirect imports within its package. Code
of other sources is never found, and removed when newer code is written.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

try:
    from numba import njit
    from numba.core.caching import CompileResultCacheImpl, FunctionCache
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        "the virtual plant needs Numba, which is not installed: pip install numba; recordings are"
        " imported, identified, validated and reported without it",
        name=error.name,
    ) from error

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import ModuleType

F = TypeVar("F", bound="Callable[..., object]")

RELAXED = {"reassoc", "contract", "arcp", "nsz"}
IN_ORDER = {"contract"}


def compiled(function: F) -> F:
    """Compile `function`."""
    return _kept_on_disk(function, njit(fastmath=RELAXED, error_model="numpy"))


def inlined(function: F) -> F:
    """Compile `function` and inline it in the callers."""
    return _kept_on_disk(function, njit(fastmath=RELAXED, error_model="numpy", inline="always"))


def ordered(function: F) -> F:
    """Compile `function` with operations in the written order, for any caller.

    Numba would apply the floating-point rules of the caller to a function without rules.
    """
    return _kept_on_disk(function, njit(fastmath=IN_ORDER, error_model="numpy"))


def _kept_on_disk(function: F, compiler: Callable[[F], Any]) -> F:
    dispatcher = compiler(function)
    # same effect as `cache=True`, with a different cache
    dispatcher._cache = _Cache(function)  # type: ignore[no-untyped-call]
    return cast("F", dispatcher)


class _Named(CompileResultCacheImpl):
    """Numba's storage of compiled code, in files named after a digest of the sources."""

    def __init__(self, function: Callable[..., object]) -> None:
        self.digest = _digest(sys.modules[function.__module__])
        super().__init__(function)  # type: ignore[no-untyped-call]

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        base = super().get_filename_base(fullname, abiflags)  # type: ignore[no-untyped-call]
        return f"{base}-{self.digest}"


class _Cache(FunctionCache):
    """Numba's cache of a function, without code compiled from older sources."""

    _impl_class = _Named

    def save_overload(self, sig: object, data: object) -> None:
        super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        function = self._impl.filename_base.partition("-")[0]
        for path in Path(self.cache_path).glob(f"{function}-*.nb[ci]"):
            if self._impl.digest not in path.name:
                path.unlink(missing_ok=True)  # another process may be faster


@cache
def _digest(module: ModuleType) -> str:
    """Return a digest of the sources of `module` and its imports within the package."""
    package = module.__name__.partition(".")[0]
    sources: dict[str, bytes] = {}
    names = [module.__name__]
    while names:
        name = names.pop()
        if name in sources or name not in sys.modules:
            continue  # already visited modules, or names defined in a module
        if file := sys.modules[name].__file__:
            sources[name] = Path(file).read_bytes()
            names += _imports(sources[name], package)
    return hashlib.sha256(repr(sorted(sources.items())).encode()).hexdigest()[:16]


@cache
def _imports(source: bytes, package: str) -> list[str]:
    """Return the names within `package` imported at the top level of a module."""
    names: list[str] = []
    for node in ast.parse(source).body:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [f"{node.module}", *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [name for name in names if name.partition(".")[0] == package]
