"""A chart as one SVG file, for papers: light, with its legend, needing nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from hil.report.charts.elements import key, number, text
from hil.report.charts.svg import drawn, size_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.report.charts.chart import Chart, Panel

STYLE = Path(__file__).parent / "chart.css"
WIDE = 1080.0
"""Of a row of panels, at most."""
LEGEND = 26.0
"""Height of the legend."""
LETTER = 6.2
"""Width of a letter in it, about."""


def file(chart: Chart) -> bytes:
    """Draw a chart into a file."""
    placed = list(_placed(chart))
    width = max((x + size_of(panel)[0] for x, _, panel in placed), default=1.0)
    height = max((y + size_of(panel)[1] for _, y, panel in placed), default=1.0)
    size = f'width="{number(width)}" height="{number(height)}"'
    box = f"0 0 {number(width)} {number(height)}"
    return "".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{box}" class="chart">',
            f"<style>{STYLE.read_text(encoding='utf-8')}</style>",
            '<rect width="100%" height="100%" fill="#fff"/>',
            *_legend(chart),
            *(_moved(x, y, "".join(drawn(panel))) for x, y, panel in placed),
            "</svg>\n",
        )
    ).encode()


def _placed(chart: Chart) -> Iterator[tuple[float, float, Panel]]:
    """Where each panel begins, row by row."""
    x, y, row = 0.0, LEGEND if chart.legend else 0.0, 0.0
    for panel in chart.panels:
        width, height = size_of(panel)
        if x and x + width > WIDE:
            x, y, row = 0.0, y + row, 0.0
        yield x, y, panel
        x, row = x + width, max(row, height)


def _legend(chart: Chart) -> Iterator[str]:
    x = 52.0
    for label, item in chart.legend.items():
        yield _moved(x, 6, "".join(key(item)) + text(31, 10, label, "begin"))
        x += 45.0 + LETTER * len(label)


def _moved(x: float, y: float, content: str) -> str:
    return f'<g transform="translate({number(x)} {number(y)})">{content}</g>'
