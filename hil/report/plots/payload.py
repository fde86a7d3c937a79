"""The plot of elements without and with a load: the paper's Figs. 5 and 6.

Call and save it within `hil.report.plots.style.plotting`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import MaxNLocator

from hil.report.plots.style import MEASURED, MODEL, MUTED, legend, panels_in_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind
    from hil.results.payload_file import ElementRecord


def with_and_without_load(
    without: Sequence[ElementRecord],
    loaded: Sequence[ElementRecord],
    kind: ElementKind,
    robot: Robot,
) -> Figure:
    """The paper's Figs. 5 and 6: elements of both runs over configuration number.

    Parameters
    ----------
    without, loaded : sequence of ElementRecord
    kind : ElementKind
        Of the elements that are drawn.
    robot : Robot
    """
    runs = [[each for each in run if each.kind == kind.name] for run in (without, loaded)]
    axes = sorted({each.axis for run in runs for each in run})
    figure, panels = panels_in_rows(len(axes), height=2.3)
    for axis, (panel,) in zip(axes, panels, strict=True):
        for run, colour, mark, line, state in zip(
            runs, (MUTED, MEASURED), ("o", "x"), ("-", "--"), ("without", "with"), strict=True
        ):
            x = [k for k, each in enumerate(run, start=1) if each.axis == axis]
            own = [each for each in run if each.axis == axis]
            panel.plot(x, [each.model for each in own], line, color=MODEL, linewidth=0.9,
                       label=f"model {state} load")  # fmt: skip
            panel.plot(x, [each.value for each in own], mark, color=colour, markersize=4,
                       markerfacecolor="none", label=f"measured {state} load")  # fmt: skip
        panel.set_title(f"${kind.element(axis - 1, axis - 1)}$", fontsize=11)
        panel.set_xlabel("configuration number")
        panel.set_ylabel(f"{kind.quantity} [{kind.unit_of(robot, axis - 1, axis - 1)}]")
        panel.margins(y=0.12)
        panel.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    if panels:
        legend(figure, panels[0][0])
    return figure
