"""Packages whose name is a function's, too: ``hil.report`` is a package, and writes a report."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class CallablePackage(ModuleType):
    """A package that is called as the function of its name in the public table of `hil`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function."""
        package, _, name = self.__name__.partition(".")
        return vars(sys.modules[package])["public"](name)(*arguments, **options)


def make_callable(name: str) -> None:
    """Make a package callable, from within it."""
    sys.modules[name].__class__ = CallablePackage
