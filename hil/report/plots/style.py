"""How plots that commands write as PNG files look and where their panels stand.

Figures are made with matplotlib's objects alone. There is no global state to set up or to leave
behind but the style, which holds within `plotting`. Margins are fixed in inches, since engines that
find them out take most of the time that a figure takes.
"""

from __future__ import annotations

import io
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from hil.report.charts.colours import GRID, INK, MUTED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.gridspec import GridSpec

WIDTH = 10.0
"""Of a figure [inch]; reports scale it to the page."""
DPI = 160
STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.titlesize": 9.5, "axes.titleweight": "bold", "axes.titlelocation": "left",
    "axes.titley": 1.0,  # else every draw looks for a place above all that stands there
    "axes.labelsize": 9, "axes.edgecolor": MUTED, "axes.labelcolor": INK, "text.color": INK,
    "axes.linewidth": 0.7, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": GRID, "grid.linewidth": 0.7, "axes.axisbelow": True,
    "xtick.color": INK, "ytick.color": INK, "xtick.labelsize": 8, "ytick.labelsize": 8,
    "lines.linewidth": 1.1, "legend.frameon": False, "legend.fontsize": 8.5,
    "figure.facecolor": "white", "svg.hashsalt": "hil",
}  # fmt: skip


@contextmanager
def plotting() -> Iterator[None]:
    """Style of everything drawn and saved within."""
    with mpl.rc_context(STYLE):
        yield


def image(figure: Figure, kind: str) -> bytes:
    """Write a figure as ``svg`` or ``png``."""
    FigureCanvasAgg(figure)
    content = io.BytesIO()
    metadata = {"Date": None} if kind == "svg" else None
    figure.savefig(content, format=kind, dpi=DPI, metadata=metadata)
    return content.getvalue()


def panels_in_rows(
    n: int, height: float, strip: float = 0.0
) -> tuple[Figure, list[tuple[Axes, ...]]]:
    """A figure with `n` panels, up to three in a row, each with a strip of details below or not."""
    columns = 2 if n == 4 else min(max(n, 1), 3)
    rows = max(-(-n // columns), 1)
    width = WIDTH if columns > 1 else 0.6 * WIDTH
    figure, grid = fixed_grid(width, 0.3 + height * rows, rows, columns)
    panels: list[tuple[Axes, ...]] = []
    for k in range(n):
        cell = grid[divmod(k, columns)]
        if strip:
            inner = cell.subgridspec(2, 1, height_ratios=[1.0, strip], hspace=0.12)
            above = figure.add_subplot(inner[0])
            panels.append((above, figure.add_subplot(inner[1], sharex=above)))
        else:
            panels.append((figure.add_subplot(cell),))
    return figure, panels


def fixed_grid(
    width: float, height: float, rows: int, columns: int, ratios: Sequence[float] | None = None
) -> tuple[Figure, GridSpec]:
    """A figure and its grid with fixed margins [inch]; a layout engine takes most of the time."""
    figure = Figure(figsize=(width, height))
    inner = (width - 0.75 - (columns - 1) * 0.85) / columns, (height - 1.05) / rows
    inner = inner[0], inner[1] - (rows - 1) / rows * 0.75
    grid = figure.add_gridspec(
        rows, columns, width_ratios=ratios,
        left=0.65 / width, right=1 - 0.1 / width, bottom=0.5 / height, top=1 - 0.55 / height,
        wspace=0.85 / inner[0], hspace=0.75 / inner[1],
    )  # fmt: skip
    return figure, grid


def legend(figure: Figure, panel: Axes) -> None:
    """Explain the marks of `panel` above all panels."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper right", ncols=len(handles))
