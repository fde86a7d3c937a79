"""What a report is made of: sections, each with its text, tables and plots."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from hil.report.plots.style import image

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

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
        return "data:image/svg+xml;base64," + base64.b64encode(self.image("svg")).decode()


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
