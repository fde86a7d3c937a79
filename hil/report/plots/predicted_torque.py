"""One axis's torque over time: measured, predicted, and below it what is left."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from hil.report.charts.colours import MEASURED, MODEL, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

POINTS = 1500
"""Of a line, at most."""
APART = 0.5
"""Time between samples from which on no line joins them [s]."""


def drawn(time: Array) -> tuple[slice, Array, Array]:
    """Which samples are drawn, when since the first [s], and NaN after a hole, 0 elsewhere."""
    shown = slice(None, None, max(1, -(-len(time) // POINTS)))
    t = time[shown] - time[0]
    return shown, t, np.where(np.diff(t, prepend=t[:1]) > APART, np.nan, 0.0)


def draw_prediction(
    panel: Axes,
    strip: Axes,
    time: Array,
    measured: Array,
    predicted: Array,
    half_width: Array | None = None,
) -> None:
    """Draw a prediction beside what was measured, and the residual in the strip below.

    Parameters
    ----------
    time, measured, predicted : ndarray, shape (n,)
        [s], [N m or N].
    half_width : ndarray, shape (n,), optional
        Of the 95 % interval of the prediction [N m or N].
    """
    shown, t, hole = drawn(time)
    residual = (measured - predicted)[shown] + hole
    panel.plot(t, measured[shown] + hole, color=MEASURED, label="measured")
    panel.plot(t, predicted[shown] + hole, "--", color=MODEL, label="predicted")
    panel.tick_params(labelbottom=False)
    strip.plot(t, residual, color=MUTED, linewidth=0.7)
    if half_width is not None:
        width, below = half_width[shown], predicted[shown] - half_width[shown]
        look: dict[str, Any] = {"color": MODEL, "alpha": 0.25, "linewidth": 0}
        panel.fill_between(t, below, below + 2 * width, label="95 % interval", **look)
        strip.fill_between(t, -width, width, **look)
    size = 1.1 * float(np.nanmax(np.abs(residual), initial=1e-9))
    strip.set_ylim(-size, size)
    strip.set_ylabel("residual")
    strip.set_xlabel("time [s]")
