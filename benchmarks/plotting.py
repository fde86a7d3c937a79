"""Figures of benchmarks by Matplotlib: one style, and reproducible files.

Figures use Matplotlib's object-oriented interface. The only global state is the style, set within
`plotting`.
"""

from __future__ import annotations

import io
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg

from hil.show.charts.chart import GRID, INK, MUTED

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.titlesize": 9.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.titley": 1.0,  # otherwise every draw searches for a place above all other elements
    "axes.labelsize": 9, "axes.edgecolor": MUTED, "axes.labelcolor": INK, "text.color": INK,
    "axes.linewidth": 0.7, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": GRID, "grid.linewidth": 0.7, "axes.axisbelow": True,
    "xtick.color": INK, "ytick.color": INK, "xtick.labelsize": 8, "ytick.labelsize": 8,
    "lines.linewidth": 1.1, "legend.frameon": False, "legend.fontsize": 8.5,
    "figure.facecolor": "white", "svg.hashsalt": "hil",
}  # fmt: skip


@contextmanager
def plotting() -> Iterator[None]:
    """Set the style of everything drawn and saved within."""
    with mpl.rc_context(STYLE):
        yield


def image(figure: Figure, kind: str) -> bytes:
    """Return a figure as the content of an ``svg`` file, or of a ``png`` file with 160 dpi."""
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    figure.savefig(content, format=kind, dpi=160, metadata=metadata)
    return content.getvalue()
