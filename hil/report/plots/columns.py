"""Columns of small panels that show the same over one joint angle each, side by side in one.

Matplotlib takes some 50 ms for each pair of axes. A row of panels that share their vertical axis
has only one pair here, and is divided along the horizontal one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.ticker import MaxNLocator, MultipleLocator

from hil.report.plots.style import GRID, MODEL, MUTED
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_PITCH = 1.1
"""From the beginning of a column to that of the next one, in widths of a column."""
_NARROW = 4.0
"""Positions that are shown at least: a joint that hardly moved is not blown up [deg or mm]."""
_MARGIN = 0.08
"""On both sides of the angles, as share of their range."""
_FRAME = 0.7
"""Width of lines."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column over the position of `joint` (from 0), which it shows from `low` to `high`.

    Angles are shown in degrees, and where the joint slides millimetres.
    """

    joint: int
    low: float
    high: float
    turns: bool = True

    @classmethod
    def of(cls, joint: int, positions: Sequence[float], *, turns: bool = True) -> Column:
        """Column that shows `positions` [rad or m]."""
        shown = _shown(np.array(positions), turns) if positions else np.zeros(1)
        low, high = float(shown.min()), float(shown.max())
        half = max((0.5 + _MARGIN) * (high - low), _NARROW / 2)
        return cls(joint, (low + high) / 2 - half, (low + high) / 2 + half, turns)

    @property
    def begin(self) -> float:
        """Where the column begins along a panel."""
        return _PITCH * self.joint

    @property
    def ticks(self) -> list[float]:
        """Positions with a mark, right angles where the joint turns far [deg or mm]."""
        span = self.high - self.low
        right = self.turns and span > _NARROW
        locator = MultipleLocator(180 if span > 340 else 90) if right else MaxNLocator(3)
        found: list[float] = np.asarray(locator.tick_values(self.low, self.high)).tolist()
        return [tick for tick in found if self.low <= tick <= self.high]

    def place(self, positions: Sequence[float]) -> Array:
        """Where `positions` [rad or m] stand along a panel."""
        return self.along(_shown(np.array(positions), self.turns))

    def along(self, shown: Array) -> Array:
        """Where positions as they are shown stand along a panel [deg or mm]."""
        place: Array = self.begin + (shown - self.low) / (self.high - self.low)
        return place


def _shown(positions: Array, turns: bool) -> Array:
    """Positions as they are shown, from rad or m [deg or mm]."""
    shown: Array = np.degrees(positions) if turns else 1e3 * positions
    return shown


def draw_columns(panel: Axes, columns: Sequence[Column]) -> None:
    """Draw frames, grids and zero lines of a panel that holds its data by now."""
    begins = [column.begin for column in columns]
    panel.set_xlim(0.0, begins[-1] + 1.0)
    panel.set_xticks([])
    panel.margins(y=0.12)
    panel.yaxis.set_major_locator(MaxNLocator(4))
    panel.grid(visible=False)
    panel.spines[:].set_visible(False)
    low, high = panel.get_ylim()
    levels = [level for level in panel.get_yticks() if low <= level <= high]
    places = [x for column in columns for x in column.along(np.array(column.ticks))]
    _lines(panel, [((x, low), (x, high)) for x in places], color=GRID, zorder=0.5)
    _lines(panel, [((x, y), (x + 1, y)) for x in begins for y in levels], color=GRID, zorder=0.5)
    _lines(panel, [((x, 0.0), (x + 1, 0.0)) for x in begins], color=MODEL, linewidth=0.9)
    frame = [((x, high), (x, low), (x + 1, low)) for x in begins]
    _lines(panel, frame, color=MUTED, clip_on=False, zorder=2.5)
    panel.set_ylim(low, high)


def label_columns(panel: Axes, columns: Sequence[Column]) -> None:
    """Write angles and joints below the lowest panel."""
    ticks = [(x, tick) for column in columns
             for x, tick in zip(column.along(np.array(column.ticks)), column.ticks,
                                strict=True)]  # fmt: skip
    panel.set_xticks([x for x, _ in ticks], [signed(f"{tick:g}") for _, tick in ticks])
    for column in columns:
        panel.annotate(
            f"$q_{{{column.joint + 1}}}$ [{'deg' if column.turns else 'mm'}]",
            (column.begin + 0.5, 0.0),
            xycoords=panel.get_xaxis_transform(), xytext=(0, -19), textcoords="offset points",
            ha="center", va="top",
        )  # fmt: skip


def _lines(panel: Axes, segments: Sequence[Any], **style: Any) -> None:
    panel.add_collection(LineCollection(segments, **{"linewidth": _FRAME, **style}), autolim=False)
