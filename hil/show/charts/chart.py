"""Chart as data: panels with items. `hil.show.charts.svg` draws charts.

Lengths are in units of the panel's SVG; 96 of them make an inch of paper. Names of quantities may
be written ``$g_{1}$``, with their index. Colours have names, so that a page can show them on light
and dark paper.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import ArrayLike


INK, MUTED, GRID = "#1f2933", "#7b8794", "#e4e7eb"
MEASURED, MODEL = "#1f5fa8", "#d9730d"
GREEN, PURPLE = "#3f8f5f", "#8a5fb0"
NAMES = {
    INK: "ink", MUTED: "faint", MEASURED: "measured", MODEL: "model", GREEN: "green",
    PURPLE: "purple",
}  # fmt: skip
"""Style-sheet classes of colours; further colours are used literally."""
_STOPS = ((124, 104, 214), (62, 130, 204), (32, 150, 140), (92, 160, 72), (192, 146, 40))


def ordered_colours(n: int) -> list[str]:
    """Return colours for `n` ordered items, from violet to amber, for light and dark paper."""
    return [_between(k * (len(_STOPS) - 1) / max(n - 1, 1)) for k in range(n)]


def _between(place: float) -> str:
    first = min(int(place), len(_STOPS) - 2)
    share = place - first
    pairs = zip(_STOPS[first], _STOPS[first + 1], strict=True)
    return "#" + "".join(f"{round(a + share * (b - a)):02x}" for a, b in pairs)


Mark = Literal["x", "o", "s", "^", "ring"]
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """Marks at (`x`, `y`).

    Attributes
    ----------
    error : array_like, shape (n,), optional
        Half-lengths of bars through the marks, upright or `along` the horizontal axis.
    ids : sequence of str
        Ids of the measurements behind the points, if any, as links to recordings.
    label : str
        Label in the legend, where equal labels appear once.
    """

    x: ArrayLike
    y: ArrayLike
    mark: Mark = "x"
    colour: str = MEASURED
    label: str = ""
    error: ArrayLike | None = None
    ids: Sequence[str] = ()
    along: bool = False
    size: float = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Line through (`x`, `y`), interrupted at NaN."""

    x: ArrayLike
    y: ArrayLike
    colour: str = MODEL
    label: str = ""
    dash: str = ""
    width: float = 1.3
    opacity: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Area between `low` and `high` over `x`, interrupted at NaN."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    colour: str = MODEL
    label: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Rule:
    """Straight line across the panel, horizontal or vertical."""

    at: float
    upright: bool = False
    colour: str = MUTED
    label: str = ""
    dash: str = ""


Item = Points | Line | Band | Rule


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """Content over a horizontal axis.

    Attributes
    ----------
    items : sequence of Item
        Items from the back to the front.
    x_range, y_range : pair of float, optional
        Minimum ranges of the axes; by default the extent of the items.
    ticks : mapping, optional
        Positions and labels of marks on the horizontal axis.
    rows : mapping, optional
        Positions and labels of marks on the vertical axis.
    decades : bool
        True for a logarithmic horizontal axis.
    whole : bool
        True to mark only whole numbers on the horizontal axis.
    below : Panel, optional
        A strip over the same horizontal axis.
    width, height : float
        Width of the whole panel, and height of the field inside the axes.
    left : float
        Space for labels of the vertical axis.
    above : bool
        True to write the labels of `rows` above them, inside the axes.
    recording : str
        Id of the recording with its time on the horizontal axis [s], if any.
    axis : int, optional
        Axis, from 0, with its torque in that recording on the vertical axis.
    """

    items: Sequence[Item]
    title: str = ""
    x_label: str = ""
    y_label: str = ""
    x_range: Range | None = None
    y_range: Range | None = None
    ticks: Mapping[float, str] | None = None
    rows: Mapping[float, str] | None = None
    decades: bool = False
    whole: bool = False
    below: Panel | None = None
    width: float = 350.0
    height: float = 150.0
    left: float = 66.0
    above: bool = False
    recording: str = ""
    axis: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Panels in rows, as many per row as fit."""

    panels: Sequence[Panel] = field(default_factory=tuple)

    @property
    def legend(self) -> dict[str, Item]:
        """Labelled items, by label."""
        labelled: dict[str, Item] = {}
        for item in self.items():
            if item.label:
                labelled.setdefault(item.label, item)
        return labelled

    @property
    def ids(self) -> frozenset[str]:
        """Ids of measurements behind the points."""
        return frozenset(each for i in self.items() if isinstance(i, Points) for each in i.ids)

    def items(self) -> Iterator[Item]:
        """Yield the items of the panels."""
        for panel in self.panels:
            yield from panel.items
            if panel.below is not None:
                yield from panel.below.items
