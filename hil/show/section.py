"""Sections of a report: text, tables and plots."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hil.show.charts import svg
from hil.show.charts.chart import Chart
from hil.show.charts.svg import file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from markupsafe import Markup

    from hil.show.charts.chart import Panel


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
