"""Charts as SVG: panels for a page, each a picture that takes the width it is given; or one file.

Text stays text, and colours are classes that the page's style sheet gives for light and dark paper.
Points of measurements carry the measurement's id (``data-m``), which `report.js` shows and follows.
A file is for papers: light, with its legend, needing nothing else.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from hil.report.charts.axis import Scale, shown, text_of
from hil.report.charts.chart import Matrix
from hil.report.charts.elements import SCALE, item_on, key, matrix_in, number, text

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.report.charts.chart import Chart, Panel

RIGHT, TOP, BOTTOM, BETWEEN = 16.0, 22.0, 36.0, 9.0
"""Margins around the field of a panel, beside its own on the left, and of the strip below it."""


def panels(chart: Chart) -> list[Markup]:
    """Each panel of a chart as an ``svg`` element."""
    return [_svg(*size_of(each), "".join(drawn(each))) for each in chart.panels]


def legend(chart: Chart) -> list[tuple[Markup, str]]:
    """What explains a chart's marks: a small picture and its label."""
    return [(_svg(26, 12, "".join(key(item))), label) for label, item in chart.legend.items()]


def size_of(panel: Panel) -> tuple[float, float]:
    """Width and height of a panel's picture."""
    if any(isinstance(item, Matrix) for item in panel.items):
        return panel.width, TOP + panel.height + SCALE
    strip = 0.0 if panel.below is None else panel.below.height + BETWEEN
    return panel.width, TOP + panel.height + strip + BOTTOM


def drawn(panel: Panel) -> Iterator[str]:
    """All elements of a panel."""
    for item in panel.items:
        if isinstance(item, Matrix):
            yield from matrix_in(item, panel.left, TOP, panel.height, panel.x_label)
            return
    both = [*panel.items, *(panel.below.items if panel.below else ())]
    reach = shown(both, panel.x_range, along=True, decades=panel.decades)
    x = Scale(*reach, panel.left, panel.width - RIGHT, panel.decades)
    marks = x.marks(int((x.end - x.begin) / 55.0), whole=panel.whole)  # about so far apart
    along = text_of(marks if panel.ticks is None else panel.ticks, x)
    top = bottom = TOP
    if panel.title:
        yield text(panel.left, 13, panel.title, "title")
    for field in (panel, panel.below):
        if field is not None:
            bottom = top + field.height
            yield from _field(field, x, top, [at for at, _ in along])
            top = bottom + BETWEEN
    for at, words in along:
        yield text(at, bottom + 13, words, "middle")
    yield text((x.begin + x.end) / 2, bottom + 29, panel.x_label, "middle")


def _field(panel: Panel, x: Scale, top: float, along: list[float]) -> Iterator[str]:
    """Draw the field inside a pair of axes, with the marks of the vertical one."""
    bottom = top + panel.height
    y = Scale(*shown(panel.items, panel.y_range, along=False, decades=False), bottom, top)
    marks = y.marks(max(2, int(panel.height / 26.0)))  # about so far apart
    up = text_of(marks if panel.rows is None else panel.rows, y)
    across = f"{number(x.begin)} {{}}H{number(x.end)}"
    grid = [f"M{number(at)} {number(top)}V{number(bottom)}" for at in along]
    grid += [f"M{across.format(number(at))}" for at, _ in up]
    yield f'<path class="grid" d="{"".join(grid)}"/>'
    for item in panel.items:
        yield from item_on(item, x, y)
    frame = f"M{number(x.begin)} {number(top)}V{number(bottom)}H{number(x.end)}"
    yield f'<path class="frame" d="{frame}"/>'
    for at, words in up:
        yield text(x.begin - 5, at + 3.5, words, "end")
    if panel.y_label:
        yield text(11, (top + bottom) / 2, panel.y_label, "middle", turned=True)


def _svg(width: float, height: float, content: str) -> Markup:
    box = f"0 0 {number(width)} {number(height)}"
    return Markup(f'<svg viewBox="{box}">{content}</svg>')  # noqa: S704 - text is escaped


STYLE = Path(__file__).parent / "chart.css"


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
    """Where each panel begins, below a legend of height 26, in rows of at most 1080."""
    x, y, row = 0.0, 26.0 if chart.legend else 0.0, 0.0
    for panel in chart.panels:
        width, height = size_of(panel)
        if x and x + width > 1080.0:
            x, y, row = 0.0, y + row, 0.0
        yield x, y, panel
        x, row = x + width, max(row, height)


def _legend(chart: Chart) -> Iterator[str]:
    x = 52.0
    for label, item in chart.legend.items():
        yield _moved(x, 6, "".join(key(item)) + text(31, 10, label, "begin"))
        x += 45.0 + 6.2 * len(label)  # about the width of a letter


def _moved(x: float, y: float, content: str) -> str:
    return f'<g transform="translate({number(x)} {number(y)})">{content}</g>'
