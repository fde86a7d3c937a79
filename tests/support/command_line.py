"""Type of the fixture `hil`, which calls the command line."""

from collections.abc import Callable

Hil = Callable[..., tuple[int, str, str]]
"""Function that takes arguments and returns exit status, standard output and standard error."""
