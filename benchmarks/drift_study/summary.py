"""Figures of a study: each method in each scenario, over all seeds, as a table and as a picture."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from benchmarks import figures
from benchmarks.plotting import image, plotting
from hil.model.dependencies import DIAGONAL, GROUPS
from hil.runs.atomic_file import write_file
from hil.show.charts.chart import GRID, INK, MEASURED, MODEL, MUTED

from .campaigns import KINDS
from .cell import OUR_DEFAULT
from .scenarios import SCENARIOS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from .cell import Outcome
    from .drift import Judged

TABLE, PICTURE = "study.csv", "study"
LEGEND = "error of predicted rigid-body torques, %\na dot for each plant, a bar for their rms"
LABELS, PANEL, BELOW = 3.4, 1.85, 0.62
"""Widths of the column of method names and of a panel, and height below the panels [inch]."""


@dataclass(frozen=True, slots=True, eq=False)
class MethodScore:
    """Scores of one method in one scenario.

    Attributes
    ----------
    scenario, method : str
    n : int
        Number of seeds.
    group_error : dict
        Relative, root mean square over the seeds.
    torque_error : float
        Relative error of the torques, root mean square over the seeds.
    torque_errors : tuple of float
        Torque errors of the seeds.
    ratio : float
        `torque_error` over that of the default method of `hil` in the same scenario; NaN if
        unknown.
    coverage : float
        Share of intervals of 95 % that hold the truth.
    """

    scenario: str
    method: str
    n: int
    group_error: dict[str, float]
    torque_error: float
    torque_errors: tuple[float, ...]
    ratio: float
    coverage: float


def summarise(found: Sequence[Judged]) -> list[MethodScore]:
    """Collect the outcomes of all seeds, the methods of `hil` first."""
    cases: dict[tuple[str, str], list[int]] = {}
    ordered = sorted(found, key=_place)
    flat = [(each.cell.scenario, outcome) for each in ordered for outcome in each.outcomes]
    for number, (scenario, outcome) in enumerate(flat):
        cases.setdefault((scenario, outcome.method), []).append(number)
    ours = {
        scenario: _rms([flat[k][1].torque_error for k in numbers])
        for (scenario, method), numbers in cases.items()
        if method == OUR_DEFAULT
    }
    return [
        _row(scenario, method, [flat[k][1] for k in numbers], ours.get(scenario, np.nan))
        for (scenario, method), numbers in cases.items()
    ]


def write(folder: Path, rows: Sequence[MethodScore]) -> None:
    """Write the table as CSV and the picture as SVG and PNG into the study's folder."""
    text = io.StringIO()
    writer = csv.writer(text)
    headings = ("scenario", "method", "seeds", *GROUPS, "torque", "ratio", "coverage")
    writer.writerow(headings)
    for row in rows:
        groups = [row.group_error.get(group, np.nan) for group in GROUPS]
        figures = [*groups, row.torque_error, row.ratio, row.coverage]
        writer.writerow([row.scenario, row.method, row.n, *(f"{x:.6g}" for x in figures)])
    write_file(folder / TABLE, text.getvalue().encode())
    for kind in ("svg", "png"):
        with plotting():
            write_file(folder / f"{PICTURE}.{kind}", image(picture(rows), kind))


def keep_figures(rows: Sequence[MethodScore], seeds: Sequence[int], command: str) -> None:
    """Keep errors and coverage of intervals, by scenario and method."""
    kept: dict[str, figures.Figure] = {}
    for row in rows:
        name = re.sub(r"\W+", "-", f"{row.scenario} {row.method}")
        scatter = 100 * float(np.std(row.torque_errors))
        kept[name] = figures.Figure(100 * row.torque_error, "%", scatter=scatter)
        kept[f"{name}-diagonal"] = figures.Figure(100 * row.group_error[DIAGONAL], "%")
        kept[f"{name}-inside"] = figures.Figure(100 * row.coverage, "%")
    figures.keep(
        "drift", kept, depends=("hil/estimation", "hil/least_squares", "benchmarks/rivals"),
        command=command, seeds=seeds,
    )  # fmt: skip


def picture(rows: Sequence[MethodScore]) -> Figure:
    """Draw the torque errors of all methods: panels by scenario, dots by seed, bars for the rms."""
    scenarios = list(dict.fromkeys(row.scenario for row in rows))
    methods = list(dict.fromkeys(row.method for row in rows))
    titles = [SCENARIOS[scenario].says.replace(", ", "\n") for scenario in scenarios]
    above = 0.15 + 0.15 * max(1 + title.count("\n") for title in titles)
    height = above + BELOW + 0.2 * len(methods)
    width = LABELS + max(PANEL * len(scenarios), 3.2)
    figure = Figure(figsize=(width, height))
    panels = figure.subplots(1, len(scenarios), sharex=True, sharey=True, squeeze=False)[0]
    left, right = LABELS / width, 1 - 0.12 / width
    figure.subplots_adjust(
        left=left, right=right, wspace=0.13, bottom=BELOW / height, top=1 - above / height
    )
    for panel, scenario, title in zip(panels, scenarios, titles, strict=True):
        _panel(panel, methods, {r.method: r for r in rows if r.scenario == scenario})
        panel.set_title(title, fontsize=8.5)
    panels[0].set_yticks(range(len(methods)), methods)
    panels[0].set_ylim(len(methods) - 0.5, -0.5)
    figure.supxlabel(LEGEND, x=(left + right) / 2, y=0.06 / height, fontsize=8.5, color=INK)
    return figure


def _panel(panel: Axes, methods: Sequence[str], rows: dict[str, MethodScore]) -> None:
    for place, method in enumerate(methods):
        row = rows.get(method)
        if row is None:
            continue
        colour = MODEL if method == OUR_DEFAULT else MEASURED
        errors = 100 * np.array(row.torque_errors)
        panel.plot(errors, np.full(row.n, place), "o", ms=3, color=colour, alpha=0.5, mew=0)
        panel.plot(100 * row.torque_error, place, "|", ms=11, mew=1.8, color=colour)
    panel.set_xscale("log")
    panel.xaxis.set_major_locator(LogLocator(numticks=6))
    panel.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.grid(axis="y", color=GRID)
    panel.tick_params(axis="y", length=0)
    panel.spines["left"].set_color(MUTED)


def _place(found: Judged) -> tuple[int, int]:
    """Return the sort key of a row in tables: places of its scenario and its campaign."""
    return list(SCENARIOS).index(found.cell.scenario), KINDS.index(found.cell.kind)


def _row(scenario: str, method: str, outcomes: Sequence[Outcome], ours: float) -> MethodScore:
    torques = [outcome.torque_error for outcome in outcomes]
    groups = outcomes[0].group_error
    return MethodScore(
        scenario=scenario,
        method=method,
        n=len(outcomes),
        group_error={g: _rms([outcome.group_error[g] for outcome in outcomes]) for g in groups},
        torque_error=_rms(torques),
        torque_errors=tuple(torques),
        ratio=_rms(torques) / ours,
        coverage=sum(o.inside for o in outcomes) / sum(o.n for o in outcomes),
    )


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
