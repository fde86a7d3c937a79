"""Causes of error found, excluded and invisible in the recordings."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hil.results.tables import excluded as tables
from hil.show.charts.chart import INK, Chart, Panel, Points, chart, ordered_colours
from hil.show.section import Plot, Section

if TYPE_CHECKING:
    from hil.estimation.excluded.result import Excluded, Limit
    from hil.report.reported_run import ReportedRun
    from hil.show.charts.chart import Item

LEAST = 1e-3
"""Lower end of the axis [%]: a tenth of the smallest detectable torque of measured campaigns."""


def excluded(run: ReportedRun) -> Section | None:
    """Create the section of excluded causes: findings, detectable sizes and torques."""
    proof, n_joints = run.model.excluded, run.robot.n_joints
    if proof is None:
        return None
    plot = Plot(
        "excluded",
        partial(dots, proof, n_joints),
        "Largest undetected torque by each cause, for each axis.",
        "Largest undetected torque by each cause, for each axis, in % of the axis's recorded "
        "torque. Rings: causes invisible in these recordings, at their usual size.",
    )
    values = {
        "excluded": tables.excluded(proof, n_joints),
        "sentences": tuple(tables.sentences(proof)),
    }
    return Section("What is excluded", "excluded.html", values, (plot,))


def dots(proof: Excluded, n_joints: int) -> Chart:
    """Draw the largest undetected torques by cause and axis."""
    drawn = [
        each
        for each in proof.limits
        if 100.0 * each.unnoticed > LEAST and (each.cause, each.axis) not in proof.places
    ]
    names = list(dict.fromkeys(map(_name, drawn)))
    most = max([100.0, *(100.0 * each.unnoticed for each in drawn)])
    return chart(
        Panel(
            [
                _dot(each, len(names) - names.index(_name(each)), n_joints)
                for each in sorted(drawn, key=lambda each: each.axis)
            ],
            x_label="largest undetected torque [%]",
            x_range=(LEAST, most),
            y_range=(0.4, len(names) + 0.6),
            rows={float(len(names) - k): name for k, name in enumerate(names)},
            decades=True,
            width=760.0,
            left=150.0,
            height=max(30.0 * len(names), 120.0),
        )
    )


def _name(limit: Limit) -> str:
    return f"{limit.cause} {limit.part}".strip()


def _dot(limit: Limit, row: int, n_joints: int) -> Item:
    """Draw a dot in a row: axis 1 at the top, no axis in the middle."""
    at = row + (0.35 - 0.7 * (limit.axis - 0.5) / n_joints if limit.axis else 0.0)
    torque = 100.0 * limit.unnoticed
    if limit.size is None:
        return Points([torque], [at], "ring", INK, "invisible", size=2.4)
    colour = ordered_colours(n_joints)[limit.axis - 1] if limit.axis else INK
    label = f"axis {limit.axis}" if limit.axis else "all axes"
    return Points([torque], [at], "o", colour, label, size=3.0)
