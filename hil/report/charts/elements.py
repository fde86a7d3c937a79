"""Lines, marks, text and matrices of charts as elements of SVG.

Of a matrix of shares from -1 to 1 the colour of a cell is the sign, its strength the size.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import escape

from hil.report.charts.axis import Scale
from hil.report.charts.chart import NAMES, Line, Points, Rule
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from hil.report.charts.chart import Item, Matrix

_INDEX = re.compile(r"\$(\w)_\{?(\w+)\}?\$")
_TYPESET = (
    r'<tspan class="symbol">\1</tspan><tspan class="index" dy="3">\2</tspan>'
    '<tspan dy="-3">\u200b</tspan>'
)
"""A symbol with its index, and a space of no width that goes back to the line."""
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
    """Write a length: a tenth is finer than a screen."""
    return f"{value:.1f}".removesuffix(".0")


def text(x: float, y: float, words: str, kind: str, *, turned: bool = False) -> str:
    """Write `words`, of which ``$g_{1}$`` is a symbol with its index; `kind`: a class."""
    turn = f' transform="rotate(-90 {number(x)} {number(y)})"' if turned else ""
    typeset = _INDEX.sub(_TYPESET, str(escape(words)))
    return f'<text class="{kind}" x="{number(x)}" y="{number(y)}"{turn}>{typeset}</text>'


def item_on(item: Item, x: Scale, y: Scale) -> Iterator[str]:
    """Draw an item by a pair of axes."""
    if isinstance(item, Line):
        yield _line(item, x.place(item.x), y.place(item.y))
    elif isinstance(item, Rule):
        ends = [x.begin, x.end], [y.begin, y.end]
        at = [float((x if item.upright else y).place(item.at))] * 2
        yield _line(_as_line(item), *((at, ends[1]) if item.upright else (ends[0], at)))
    elif isinstance(item, Points):
        yield from _points(item, x, y)


def key(item: Item) -> Iterator[str]:
    """Draw what stands for an item in a legend, 26 by 12."""
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
    elif isinstance(item, Line | Rule):
        yield _line(item if isinstance(item, Line) else _as_line(item), [1.0, 25.0], [6.0, 6.0])


def _as_line(rule: Rule) -> Line:
    return Line((), (), rule.colour, dash=rule.dash, width=1.0)


def _line(item: Line, x: ArrayLike, y: ArrayLike) -> str:
    dash = f' stroke-dasharray="{item.dash}"' if item.dash else ""
    faint = f' opacity="{item.opacity:g}"' if item.opacity < 1 else ""
    look = f'{_colour(item.colour)} stroke-width="{item.width:g}"{dash}{faint}'
    return f'<path{look} d="{_path(x, y)}"/>'


def _path(x: ArrayLike, y: ArrayLike) -> str:
    """Commands of a path through points, interrupted at those that are no numbers."""
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
    """Commands of a path of all bars of points."""
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


SCALE = 78.0
"""Height of the names of the columns and of the scale of colours below them."""


def matrix_in(
    matrix: Matrix, left: float, top: float, size: float, explanation: str
) -> Iterator[str]:
    """Draw a matrix into a square with its names around, and below it the scale of colours.

    Up to 20 rows leave room for figures.
    """
    n = len(matrix.names)
    few = n <= 20
    cell = size / n
    for i, name in enumerate(matrix.names):
        yield text(left - 5, top + (i + 0.65) * cell, name, "end")
        if few:
            yield text(left + (i + 0.5) * cell, top + size + 13, name, "middle")
    for i, j in np.ndindex(n, n):
        value = float(matrix.values[i, j])
        x, y = left + j * cell, top + i * cell
        if abs(value) >= 0.005:
            yield _cell(x, y, cell, cell, value)
        if few and i != j and abs(value) >= 0.05:
            yield text(x + cell / 2, y + 0.65 * cell, signed(f"{value:.1f}"), "cell")
    yield from _scale(left + size / 2, top + size + 26, explanation)


def _cell(x: float, y: float, width: float, height: float, value: float) -> str:
    sign = "plus" if value > 0 else "minus"
    size = f'width="{number(width)}" height="{number(height)}"'
    strength = f'fill-opacity="{0.85 * abs(value):.2f}"'
    return f'<rect class="{sign}" x="{number(x)}" y="{number(y)}" {size} {strength}/>'


def _scale(middle: float, top: float, explanation: str) -> Iterator[str]:
    step = 12.0
    for k in range(-10, 11):
        yield _cell(middle + (k - 0.5) * step, top, step, 9, k / 10)
    for value in (-1, -0.5, 0, 0.5, 1):
        yield text(middle + 10 * value * step, top + 21, signed(f"{value:g}"), "middle")
    yield text(middle, top + 38, explanation, "middle")
