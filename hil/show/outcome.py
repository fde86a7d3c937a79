"""Result of a command, displayed by terminal, page, notebook and JSON alike.

A command computes an `Outcome`; the display is independent of the subject. Plots, and the
recordings that a page plays, are made on demand.

A `Section` of a report is text, tables and plots.
"""

from __future__ import annotations

import base64
import io
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import escape
from rich.console import Console
from rich.text import Text

from hil.show.charts import svg
from hil.show.charts.chart import Chart
from hil.show.charts.svg import file
from hil.show.terminal import Drawn

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from pathlib import Path

    from markupsafe import Markup
    from rich.console import ConsoleOptions, RenderResult

    from hil.show.charts.chart import Panel
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


@dataclass(frozen=True, eq=False)
class Plot:
    """Plot, drawn on demand.

    Attributes
    ----------
    name : str
        Name of the plot's file; unique within a report.
    draw : callable
        Function that yields the panels.
    alternative : str
        Alternative text for readers who cannot see the plot.
    """

    name: str
    draw: Callable[[], Iterable[Panel]]
    alternative: str
    caption: str

    @cached_property
    def chart(self) -> Chart:
        """Chart, drawn once."""
        return Chart(tuple(self.draw()))

    @property
    def panels(self) -> list[tuple[float, Markup, Markup | None]]:
        """Width and picture of the panels, and narrow pictures of wide panels for telephones."""
        return [
            (panel.width, picture, svg.narrow(panel) if panel.width > 1.2 * svg.NARROW else None)
            for panel, picture in zip(self.chart.panels, svg.panels(self.chart), strict=True)
        ]

    @property
    def legend(self) -> list[tuple[Markup, str]]:
        """Legend symbols with labels."""
        return svg.legend(self.chart)

    @property
    def file(self) -> bytes:
        """SVG file of the plot."""
        return file(self.chart)


def data_uri(content: bytes, kind: str) -> str:
    """Return a data URI with the content of a file."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Section of a report.

    Attributes
    ----------
    template : str
        Template in `hil/report/sections` with the text, in which ``plots`` are available by name.
    values : mapping
        Further values for the template.
    leads : bool
        True for the section at the top of the page, without heading.
    """

    heading: str
    template: str
    values: Mapping[str, Any] = field(default_factory=dict)
    plots: tuple[Plot, ...] = ()
    leads: bool = False

    @property
    def anchor(self) -> str:
        """Anchor for links from the contents."""
        return re.sub(r"[^a-z0-9]+", "-", self.heading.lower()).strip("-")


def write_outcome(path: Path, found: Outcome) -> Path:
    """Write the page of a result atomically, and return the path.

    Raises
    ------
    FileError
        A damaged recording, or a full disk.
    """
    from hil.show.html import write_html  # noqa: PLC0415 - templates take time to load

    played = found.played()
    write_html(
        path, "result.html", played.player, found=found, title=found.title, carried=played.carried,
        picture=played.picture, plots=(*found.plots, *played.plots),
    )  # fmt: skip
    return path
