"""A load on the terminal: changed base parameters, the load itself, the drives' constants."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.tables import payload as tables
from hil.results.tables.terminal import show, show_sentence

if TYPE_CHECKING:
    from rich.console import Console

    from hil.results.payload_file import PayloadFile


def render(load: PayloadFile, console: Console) -> None:
    """Print what was found, and how well a rigid load explains it."""
    show(tables.changes(load), console)
    show(tables.quantities(load), console)
    for sentence in (tables.goodness_of_fit(load), tables.unseen(load)):
        show_sentence(sentence, console)
    show(tables.torque_constants(load), console)
