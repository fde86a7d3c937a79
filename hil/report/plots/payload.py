"""The plot of elements without and with a load: the paper's Figs. 5 and 6."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.report.charts.chart import Chart, Line, Panel, Points
from hil.report.charts.colours import MEASURED, MODEL, MUTED

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind
    from hil.report.charts.chart import Item
    from hil.results.load_file import ElementRecord


def with_and_without_load(
    without: Sequence[ElementRecord],
    loaded: Sequence[ElementRecord],
    kind: ElementKind,
    robot: Robot,
) -> Chart:
    """The paper's Figs. 5 and 6: elements of both runs over configuration number.

    Parameters
    ----------
    without, loaded : sequence of ElementRecord
        The latter of the run that is reported.
    kind : ElementKind
        Of the elements that are drawn.
    robot : Robot
    """
    runs = [[each for each in run if each.kind == kind.name] for run in (without, loaded)]
    axes = sorted({each.axis for run in runs for each in run})
    return Chart(
        tuple(
            Panel(
                (*_elements(runs[0], axis, loaded=False), *_elements(runs[1], axis, loaded=True)),
                title=f"${kind.element(axis - 1, axis - 1)}$",
                x_label="configuration number",
                y_label=f"{kind.quantity} [{kind.unit_of(robot, axis - 1, axis - 1)}]",
                whole=True,
            )
            for axis in axes
        )
    )


def _elements(run: Sequence[ElementRecord], axis: int, *, loaded: bool) -> Iterator[Item]:
    state = "with load" if loaded else "without load"
    own = [(k, each) for k, each in enumerate(run, start=1) if each.axis == axis]
    x = [k for k, _ in own]
    dash = "5 3" if loaded else ""
    yield Line(x, [each.model for _, each in own], MODEL, f"model {state}", dash, width=1.0)
    yield Points(
        x,
        [each.value for _, each in own],
        "x" if loaded else "ring",
        MEASURED if loaded else MUTED,
        f"measured {state}",
        ids=[each.id for _, each in own] if loaded else (),
    )
