"""Errors of an estimate that name the run behind it."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from hil.errors import NoLoad, NotEnoughData, NotIdentifiable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.runs.run import Run


@contextmanager
def named(run: Run) -> Iterator[None]:
    """Put the run's path before the message of an error about its measurements."""
    try:
        yield
    except (NotEnoughData, NotIdentifiable, NoLoad) as error:
        raise type(error)(f"{run.path}: {error}") from error
