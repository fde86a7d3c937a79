"""Result of a command, displayed by terminal, page, notebook and JSON alike.

A command computes an `Outcome`; the display is independent of the subject. Plots, and the
recordings that a page plays, are made on demand.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from markupsafe import escape
from rich.console import Console
from rich.text import Text

from hil.show.terminal import Drawn

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from rich.console import ConsoleOptions, RenderResult

    from hil.show.section import Plot
    from hil.show.table import Table

STYLE = "<style>.wide th, .wide td { text-align: left } .wide .number { text-align: right }</style>"
"""Style for notebooks, which would align all cells to the right."""


class Verdict(NamedTuple):
    """Sentence about a result.

    Attributes
    ----------
    kind : {"good", "doubtful", "failed", "note"}
        Colour of the sentence; a note has none.
    word : str
        Highlighted word on a page: the kind itself, or a word of the command.
    """

    kind: str
    word: str
    text: str

    def __str__(self) -> str:
        return f"{self.word}: {self.text}" if self.word == self.kind else self.text


class Played(NamedTuple):
    """Torque plots of recordings, with the recordings for playback.

    Attributes
    ----------
    carried, player, picture : str
        Recordings, compressed, the script that plays them, and the robot at their beginning.
    """

    plots: tuple[Plot, ...] = ()
    carried: str = ""
    player: str = ""
    picture: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Result of a command, for ``print`` and notebooks.

    Attributes
    ----------
    tables : tuple of Table
        Tables; those without rows are hidden.
    remarks : tuple of str
        Restrictions of the tables.
    sentences : tuple of str
        Further sentences.
    verdicts : tuple of Verdict
        Verdicts on the result, the worst first; notes last.
    title : str
        Title of the page: robot and subject.
    facts : mapping of str to str
        Facts at the top of the page, by name.
    note : str
        Note at the foot of the page.
    simulated : bool
        True if any data comes from the virtual plant.
    played : callable
        Function returning the recordings to play.
    """

    tables: tuple[Table, ...] = ()
    remarks: tuple[str, ...] = ()
    sentences: tuple[str, ...] = ()
    verdicts: tuple[Verdict, ...] = ()
    plots: tuple[Plot, ...] = ()
    title: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    simulated: bool = False
    played: Callable[[], Played] = Played

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the parts for rich."""
        del console, options
        for table in self.tables:
            if table.parts:
                yield Drawn(table)
        for sentence in self.sentences:
            yield Text(sentence)
        for remark in self.remarks:
            yield Text(remark, style="yellow")

    def __str__(self) -> str:
        text = io.StringIO()
        Console(file=text, width=100, color_system=None).print(self)
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        from hil.show.html import html  # noqa: PLC0415 - Jinja, for notebooks alone

        remarks = "".join(f"<p>{escape(each)}</p>" for each in (*self.sentences, *self.remarks))
        return STYLE + "".join(map(html, self.tables)) + remarks
