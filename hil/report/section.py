"""What a report is made of: sections, each with its text, tables and plots."""

from __future__ import annotations

import base64
import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hil.report.plots.style import image

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Plot:
    """A plot, which is drawn when it is wanted; use it within `hil.report.plots.style.plotting`.

    Attributes
    ----------
    name : str
        Of its file; unique within a report.
    draw : callable
        Returns the figure.
    alternative : str
        What it shows, for those who do not see it.
    caption : str
    """

    name: str
    draw: Callable[[], Figure]
    alternative: str
    caption: str

    @cached_property
    def figure(self) -> Figure:
        """As it was drawn."""
        return self.draw()

    def image(self, kind: str) -> bytes:
        """As a file of ``svg`` or ``png``."""
        return image(self.figure, kind)

    @property
    def uri(self) -> str:
        """As an address that holds the picture itself."""
        return data_uri(self.image("svg"), "image/svg+xml")


def data_uri(content: bytes, kind: str) -> str:
    """Return an address that holds the content of a file itself."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def picture_uri(path: Path) -> str | None:
    """Return an address that holds a PNG file; None where there is none that can be read."""
    try:
        return data_uri(path.read_bytes(), "image/png")
    except OSError:
        return None


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """A section of a report.

    Attributes
    ----------
    heading : str
    template : str
        File of `hil/report/sections` with its text; its plots are there as ``plots``, by name.
    values : mapping
        What else the template shows.
    plots : tuple of Plot
    """

    heading: str
    template: str
    values: Mapping[str, Any] = field(default_factory=dict)
    plots: tuple[Plot, ...] = ()

    @property
    def anchor(self) -> str:
        """Name under which the contents link to it."""
        return re.sub(r"[^a-z0-9]+", "-", self.heading.lower()).strip("-")
