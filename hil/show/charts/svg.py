"""Charts as SVG: responsive panels for a page, or a stand-alone file.

Text stays text, and colours are classes that the page's style sheet gives for light and dark paper.
Points carry the id of their measurement (``data-m``), which ``web/src/report.js`` shows and
follows. A file is for papers: light, with its legend, self-contained.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup, escape

from hil.show.charts.chart import NAMES, Band, Chart, Line, Points, Rule
from hil.show.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike

    from hil.arrays import Array
    from hil.show.charts.chart import Item, Panel, Range


STEPS = (1.0, 2.0, 2.5, 5.0)


@dataclass(frozen=True, slots=True)
class Scale:
    """Map from values `low` to `high` to lengths `begin` to `end`."""

    low: float
    high: float
    begin: float
    end: float
    decades: bool = False

    def place(self, values: ArrayLike) -> Array:
        """Compute the positions of values."""
        low, high, at = self.low, self.high, np.asarray(values, dtype=float)
        if self.decades:
            low, high, at = np.log10(low), np.log10(high), np.log10(at)
        found: Array = self.begin + (at - low) / (high - low) * (self.end - self.begin)
        return found

    def marks(self, most: int, *, whole: bool = False) -> dict[float, str]:
        """Return at most `most` round values with labels."""
        if self.decades:
            low = self.low
            high = self.high
            exponents = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
            few = np.log10(high / low) < 1.5
            each = (d * 10.0**e for e in exponents for d in ((1, 2, 5) if few else (1,)))
            return {value: f"{value:g}" for value in each if low <= value <= high}
        step, first, last = self._multiples(most, 1.0 if whole else 0.0)
        # the decimals needed for multiples of step
        digits = next((n for n in range(12) if abs(step * 10**n - round(step * 10**n)) < 1e-6), 12)
        return {k * step: signed(f"{k * step:.{digits}f}") for k in range(first, last + 1)}

    def _multiples(self, most: int, least: float) -> tuple[float, int, int]:
        """Find the finest round step with up to `most` multiples, and the multiples' ends."""
        size = 10.0 ** (np.floor(np.log10((self.high - self.low) / max(most, 1))) - 1)
        for step in (each * 10**k * size for k in range(4) for each in STEPS):
            first = int(np.ceil(self.low / step - 1e-9))
            last = int(np.floor(self.high / step + 1e-9))
            if last - first < most and step >= least:
                break
        return float(step), first, last


def axis_range(items: Sequence[Item], wanted: Range | None, *, along: bool, decades: bool) -> Range:
    """Return the range of an axis: `wanted`, or the extent of `items` with margins of 5 %."""
    if wanted is not None:
        return wanted
    values = np.concatenate([np.ravel(each) for each in _extents(items, along)] or [np.zeros(1)])
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if decades:
        factor = (high / low) ** 0.05 if high > low else 2.0
        return low / factor, high * factor
    margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - margin, high + margin


def _extents(items: Sequence[Item], along: bool) -> Iterator[Array]:
    for item in items:
        if isinstance(item, Rule) and item.upright == along:
            yield np.array([item.at])
        elif isinstance(item, Band):
            yield from map(np.asarray, (item.x,) if along else (item.low, item.high))
        elif isinstance(item, Line | Points):
            values = np.asarray(item.x if along else item.y, dtype=float)
            yield values
            if isinstance(item, Points) and item.error is not None and item.along == along:
                error = np.nan_to_num(np.asarray(item.error, dtype=float))
                yield values - error
                yield values + error


def text_of(marks: Mapping[float, str], axis: Scale) -> list[tuple[float, str]]:
    """Return positions and labels of marks on an axis."""
    places = axis.place(list(marks)).tolist() if marks else []
    return list(zip(places, marks.values(), strict=True))


_INDEX = re.compile(r"\$(\w)_\{?(\w+)\}?\$")
_TYPESET = (
    r'<tspan class="symbol">\1</tspan><tspan class="index" dy="3">\2</tspan>'
    '<tspan dy="-3">\u200b</tspan>'
)
"""Symbol with subscript, and a zero-width space on the baseline."""
_ROUND = "m{-s} 0a{s} {s} 0 1 0 {2s} 0a{s} {s} 0 1 0 {-2s} 0"
_SHAPES = {
    "x": "m{-s} {-s}l{2s} {2s}m0 {-2s}l{-2s} {2s}",
    "s": "m{-s} {-s}h{2s}v{2s}h{-2s}z",
    "^": "m{-s} {s}h{2s}l{-s} {-2s}z",
    "o": _ROUND,
    "ring": _ROUND,
}
_SIZE = re.compile(r"\{(-?)(2?)s\}")
_FILLED = {"x": "", "ring": ' class="ring"'}


def number(value: float) -> str:
    """Format a length with a decimal."""
    return f"{value:.1f}".removesuffix(".0")


def text(x: float, y: float, words: str, kind: str, *, turned: bool = False) -> str:
    """Draw `words` with class `kind`; ``$g_{1}$`` is a symbol with subscript."""
    turn = f' transform="rotate(-90 {number(x)} {number(y)})"' if turned else ""
    typeset = _INDEX.sub(_TYPESET, str(escape(words)))
    return f'<text class="{kind}" x="{number(x)}" y="{number(y)}"{turn}>{typeset}</text>'


def item_on(item: Item, x: Scale, y: Scale) -> Iterator[str]:
    """Draw an item in a pair of axes."""
    if isinstance(item, Line):
        yield _line(item, x.place(item.x), y.place(item.y))
    elif isinstance(item, Band):
        yield _area(item, x.place(item.x), y.place(item.low), y.place(item.high))
    elif isinstance(item, Rule):
        ends = [x.begin, x.end], [y.begin, y.end]
        at = [float((x if item.upright else y).place(item.at))] * 2
        yield _line(_convert_rule(item), *((at, ends[1]) if item.upright else (ends[0], at)))
    elif isinstance(item, Points):
        yield from _points(item, x, y)


def key(item: Item) -> Iterator[str]:
    """Draw the legend symbol of an item, 26 by 12."""
    if isinstance(item, Points):
        yield from _points(
            Points(
                [0.5],
                [0.5],
                item.mark,
                item.colour,
                error=None if item.error is None else [0.4],
                along=item.along,
                size=item.size,
            ),
            Scale(0, 1, 0, 26),
            Scale(0, 1, 12, 0),
        )
    elif isinstance(item, Band):
        yield _area(item, np.array([1.0, 25.0]), np.full(2, 11.0), np.full(2, 1.0))
    elif isinstance(item, Line | Rule):
        yield _line(
            item if isinstance(item, Line) else _convert_rule(item), [1.0, 25.0], [6.0, 6.0]
        )


def _area(item: Band, x: Array, low: Array, high: Array) -> str:
    there = np.isfinite(x + low + high)
    parts = np.split(np.arange(len(x)), np.flatnonzero(np.diff(there)) + 1)
    edges = (
        _path(np.append(x[own], x[own[::-1]]), np.append(high[own], low[own[::-1]])) + "Z"
        for own in parts
        if there[own].any()
    )
    return f'<g{_colour(item.colour)}><path class="band" d="{"".join(edges)}"/></g>'


def _convert_rule(rule: Rule) -> Line:
    return Line((), (), rule.colour, dash=rule.dash, width=1.0)


def _line(item: Line, x: ArrayLike, y: ArrayLike) -> str:
    dash = f' stroke-dasharray="{item.dash}"' if item.dash else ""
    faint = f' opacity="{item.opacity:g}"' if item.opacity < 1 else ""
    look = f'{_colour(item.colour)} stroke-width="{item.width:g}"{dash}{faint}'
    return f'<path{look} d="{_path(x, y)}"/>'


def _path(x: ArrayLike, y: ArrayLike) -> str:
    words, begun = [], False
    for a, b in np.column_stack([np.asarray(x), np.asarray(y)]).tolist():
        there = np.isfinite(a) and np.isfinite(b)
        if there:
            words.append(f"{'L' if begun else 'M'}{number(a)} {number(b)}")
        begun = bool(there)
    return "".join(words)


def _points(item: Points, x: Scale, y: Scale) -> Iterator[str]:
    across, up = x.place(item.x).tolist(), y.place(item.y).tolist()
    yield f"<g{_colour(item.colour)}>"
    if item.error is not None:
        yield f'<path class="bars" d="{_bars(item, x, y)}"/>'
    look = _FILLED.get(item.mark, ' class="full"')
    shape = _SIZE.sub(lambda s: s[1] + number(item.size * float(s[2] or 1)), _SHAPES[item.mark])
    for a, b, name in zip(across, up, item.ids or [""] * len(across), strict=True):
        behind = f' data-m="{escape(name)}"' if name else ""
        yield f'<path{look}{behind} d="M{number(a)} {number(b)}{shape}"/>'
    yield "</g>"


def _bars(item: Points, x: Scale, y: Scale) -> str:
    value = np.asarray(item.x if item.along else item.y, dtype=float)
    error = np.nan_to_num(np.asarray(item.error, dtype=float))
    own, places = (x, y.place(item.y)) if item.along else (y, x.place(item.x))
    low, high = (map(number, own.place(value + side * error).tolist()) for side in (-1, 1))
    bars = zip(map(number, places.tolist()), low, high, strict=True)
    if item.along:
        return "".join(f"M{low} {at}H{high}" for at, low, high in bars)
    return "".join(f"M{at} {low}V{high}" for at, low, high in bars)


def _colour(colour: str) -> str:
    return f' class="{NAMES[colour]}"' if colour in NAMES else f' color="{colour}"'


RIGHT, TOP, BOTTOM, BETWEEN = 16.0, 24.0, 38.0, 9.0
"""Margins around the field of a panel (left: see the panel), and gap above the strip below."""
LETTER, BESIDE = 7.6, 28.0
"""Width of a 13 px digit, and of the axis label with spacing."""

NARROW, TALLER = 350.0, 1.6
"""Width of a picture for telephones, and factor of its height with labels between its rows."""


def panels(chart: Chart) -> list[Markup]:
    """Draw the panels of a chart as ``svg`` elements."""
    return [_svg(*size_of(each), "".join(draw(each)), _clock(each)) for each in chart.panels]


def narrow(panel: Panel) -> Markup:
    """Draw a panel as an ``svg`` element for telephones, labels of rows above their rows."""
    small = replace(panel, width=NARROW)
    if panel.rows is not None:
        small = replace(small, above=True, height=TALLER * panel.height)
    return panels(Chart((small,)))[0]


def legend(chart: Chart) -> list[tuple[Markup, str]]:
    """Return legend symbols and labels."""
    return [(_svg(26, 12, "".join(key(item))), label) for label, item in chart.legend.items()]


def size_of(panel: Panel) -> tuple[float, float]:
    """Return width and height of a panel's picture."""
    strip = 0.0 if panel.below is None else panel.below.height + BETWEEN
    return panel.width, TOP + panel.height + strip + BOTTOM


def draw(panel: Panel) -> Iterator[str]:
    """Draw the elements of a panel."""
    left = _left_margin(panel)
    x = Scale(*_reach(panel), left, panel.width - RIGHT, panel.decades)
    marks = x.marks(int((x.end - x.begin) / 55.0), whole=panel.whole)  # about 55 apart
    along = text_of(marks if panel.ticks is None else panel.ticks, x)
    top = bottom = TOP
    if panel.title:
        yield text(left, 14, panel.title, "title")
    for field in (panel, panel.below):
        if field is not None:
            bottom = top + field.height
            yield from _field(field, x, top, [at for at, _ in along])
            top = bottom + BETWEEN
    for at, words in along:
        yield text(at, bottom + 15, words, "middle")
    yield text((x.begin + x.end) / 2, bottom + 33, panel.x_label, "middle")


def _left_margin(panel: Panel) -> float:
    """Return the left margin, enlarged for long labels of the vertical axis."""
    if panel.above:
        return RIGHT
    fields = (panel, *([panel.below] if panel.below else []))
    longest = max(len(words) for each in fields for _, words in _up(each, 0.0))
    return max(panel.left, BESIDE + LETTER * longest)


def _up(panel: Panel, top: float) -> list[tuple[float, str]]:
    """Return positions and labels of the vertical axis; an empty label without marks."""
    y = _upright(panel, top)
    # marks about 26 apart; with a maximum of at least three, two marks exist and show the scale
    marks = y.marks(max(3, int(panel.height / 26.0)))
    return text_of(marks if panel.rows is None else panel.rows, y) or [(top, "")]


def _upright(panel: Panel, top: float) -> Scale:
    reach = axis_range(panel.items, panel.y_range, along=False, decades=False)
    return Scale(*reach, top + panel.height, top)


def _reach(panel: Panel) -> Range:
    both = [*panel.items, *(panel.below.items if panel.below else ())]
    return axis_range(both, panel.x_range, along=True, decades=panel.decades)


def _field(panel: Panel, x: Scale, top: float, along: list[float]) -> Iterator[str]:
    """Draw the field inside the axes, with marks of the vertical axis."""
    bottom = top + panel.height
    y, up = _upright(panel, top), _up(panel, top)
    across = f"{number(x.begin)} {{}}H{number(x.end)}"
    grid = [f"M{number(at)} {number(top)}V{number(bottom)}" for at in along]
    grid += [f"M{across.format(number(at))}" for at, _ in up]
    yield f'<path class="grid" d="{"".join(grid)}"/>'
    for item in panel.items:
        yield from item_on(item, x, y)
    frame = f"M{number(x.begin)} {number(top)}V{number(bottom)}H{number(x.end)}"
    yield f'<path class="frame" d="{frame}"/>'
    row = 0.42 * float(y.place(0.0) - y.place(1.0))
    for at, words in up:
        if panel.above:
            yield text(x.begin + 4, at - row, words, "over")
        else:
            yield text(x.begin - 5, at + 4.5, words, "end")
    if panel.y_label:
        yield text(13, (top + bottom) / 2, panel.y_label, "middle", turned=True)


def _clock(panel: Panel) -> str:
    """Format the attributes that map the horizontal axis to a recording's time."""
    if not panel.recording:
        return ""
    low, high = _reach(panel)
    ends = f"{number(_left_margin(panel))} {number(panel.width - RIGHT)} {low:.4g} {high:.4g}"
    axis = "" if panel.axis is None else f' data-axis="{panel.axis}"'
    return f' data-r="{escape(panel.recording)}" data-x="{ends}"{axis}'


def _svg(width: float, height: float, content: str, attributes: str = "") -> Markup:
    box = f"0 0 {number(width)} {number(height)}"
    return Markup(f'<svg viewBox="{box}"{attributes}>{content}</svg>')  # noqa: S704 - text is escaped


STYLE = Path(__file__).parents[1] / "templates" / "chart.css"


def file(chart: Chart) -> bytes:
    """Draw a chart as a file."""
    # rows of at most 1080, below a legend of height 26
    placed: list[tuple[float, float, Panel]] = []
    x, y, row = 0.0, 26.0 if chart.legend else 0.0, 0.0
    for panel in chart.panels:
        across, high = size_of(panel)
        if x and x + across > 1080.0:
            x, y, row = 0.0, y + row, 0.0
        placed.append((x, y, panel))
        x, row = x + across, max(row, high)
    legend, at = [], 52.0
    for label, item in chart.legend.items():
        legend.append(_translate(at, 6, "".join(key(item)) + text(31, 10, label, "begin")))
        at += 45.0 + 7.2 * len(label)  # about the width of a letter
    width = max((x + size_of(panel)[0] for x, _, panel in placed), default=1.0)
    height = max((y + size_of(panel)[1] for _, y, panel in placed), default=1.0)
    size = f'width="{number(width)}" height="{number(height)}"'
    box = f"0 0 {number(width)} {number(height)}"
    return "".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{box}" class="chart">',
            f"<style>{STYLE.read_text(encoding='utf-8')}</style>",
            '<rect width="100%" height="100%" fill="#fff"/>',
            *legend,
            *(_translate(x, y, "".join(draw(panel))) for x, y, panel in placed),
            "</svg>\n",
        )
    ).encode()


def _translate(x: float, y: float, content: str) -> str:
    return f'<g transform="translate({number(x)} {number(y)})">{content}</g>'
