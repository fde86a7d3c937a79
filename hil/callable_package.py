"""Callable packages: ``hil.report`` is a package, and a function for writing a report."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """Package, callable as the function of the same name in the public table of `hil`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function."""
        package, _, name = self.__name__.partition(".")
        return vars(sys.modules[package])["public"](name)(*arguments, **options)


def make_callable(name: str) -> None:
    """Make a package callable; called by the package itself."""
    sys.modules[name].__class__ = CallablePackage
