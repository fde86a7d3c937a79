"""The plots of what a model leaves of the measurements: over all of them, and over joint angles."""

from __future__ import annotations

from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.measurement import ELEMENT_KINDS
from hil.report.charts.chart import Chart, Line, Panel, Points, Rule
from hil.report.charts.colours import MODEL, MUTED
from hil.results.rounding import signed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.local_values import LocalValue
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementKind, ElementMeasurement

    Array = NDArray[np.float64]

NARROW = 4.0
"""Range of a joint's positions up to which nothing shows over it [deg or mm]."""


def residuals(estimate: Estimate, robot: Robot, planned: Mapping[str, ElementMeasurement]) -> Chart:
    """Draw what the model leaves of every measurement, as torque; and how normal that is.

    Parameters
    ----------
    planned : mapping
        Measurements by their id.
    """
    number = {value.id: k for k, value in enumerate(estimate.local, start=1)}
    left, right = [], []
    for name, kind in ELEMENT_KINDS.items():
        values = [value for value in estimate.local if value.kind == name]
        relative = np.array([_relative(value, robot, planned[value.id]) for value in values])
        places, ids = [number[value.id] for value in values], [value.id for value in values]
        left.append(
            Points(places, 100 * relative, kind.marker, kind.colour, name, ids=ids, size=2.6)
        )
        normal, scaled = _quantiles(relative, [value.axis for value in values])
        right.append(Points(normal, scaled, kind.marker, kind.colour, ids=ids, size=2.3))
    return Chart(
        (
            Panel(
                (Rule(0.0), *left),
                title="residuals of all measurements",
                x_label="measurement, in the plan's order",
                y_label="measured − modelled [% of torque limit]",
                whole=True,
                width=700.0,
                height=220.0,
            ),
            Panel(
                (Line((-3.0, 3.0), (-3.0, 3.0), MUTED, width=1.0), *right),
                title="normal probability plot",
                x_label="quantile of the normal distribution",
                y_label="residual, centred and scaled by axis",
                height=220.0,
            ),
        )
    )


def residuals_over_angles(values: Sequence[LocalValue], robot: Robot, kind: ElementKind) -> Chart:
    """Measured less modelled elements of every axis against the position of each joint that varied.

    What is the same at all configurations of an axis is taken off: it is friction that differs by
    direction, or that step 1 takes for part of the element, and hides what depends on angles.

    Parameters
    ----------
    values : sequence of LocalValue
        Of one kind.
    robot : Robot
    kind : ElementKind
        Theirs.
    """
    axes = sorted({value.axis for value in values})
    each = ([value for value in values if value.axis == axis] for axis in axes)
    return Chart(tuple(panel for own in each for panel in _over_angles(own, robot, kind)))


def _over_angles(own: Sequence[LocalValue], robot: Robot, kind: ElementKind) -> Iterator[Panel]:
    """Panels of one axis, all with the same vertical axis."""
    axis = own[0].axis
    left = np.array([value.value - value.model for value in own])
    mean = float(left.mean())
    error = 2.0 * np.nan_to_num([value.standard_error for value in own])
    most = 1.1 * float(np.max(np.abs(left - mean) + error)) or 1.0
    unit, element = kind.unit_of(robot, axis, axis), kind.element(axis, axis)
    for joint, turns in enumerate(robot.revolute):
        shown = np.array([value.q[joint] for value in own]) * (180 / np.pi if turns else 1e3)
        if np.ptp(shown) > NARROW:
            yield Panel(
                (
                    Rule(0.0, colour=MODEL),
                    Points(shown, left - mean, error=error, ids=[value.id for value in own],
                           label="measured − modelled, ± 2 standard errors", size=2.5),
                ),
                title=f"${element}$ less mean {signed(f'{mean:.2g}')} {unit}",
                x_label=f"$q_{{{joint + 1}}}$ [{'deg' if turns else 'mm'}]",
                y_label=f"Δ${element}$ [{unit}]",
                y_range=(-most, most),
                ticks=_right_angles(shown) if turns else None,
                width=260.0,
                height=95.0,
            )  # fmt: skip


def _right_angles(shown: Array) -> dict[float, str] | None:
    """Marks at right angles, where a joint turns as far."""
    if np.ptp(shown) < 150:
        return None
    step = 180 if np.ptp(shown) > 340 else 90
    first, last = int(np.floor(shown.min() / step)), int(np.ceil(shown.max() / step))
    room = 0.05 * np.ptp(shown)
    within = (step * k for k in range(first, last + 1))
    return {
        float(each): signed(f"{each}")
        for each in within
        if shown.min() - room <= each <= shown.max() + room
    }


def _relative(value: LocalValue, robot: Robot, planned: ElementMeasurement) -> float:
    """Measured less modelled as a torque over the axis's limit, eq. (16)."""
    torque = (value.value - value.model) * planned.torque_per_element
    return float(torque / robot.torque_limit[value.axis])


def _quantiles(residual: Array, axes: Sequence[int]) -> tuple[Array, Array]:
    """Where residuals of a kind would be were they normal, and they, standardised by axis."""
    scaled, axis = residual.copy(), np.array(axes)
    for a in set(axis.tolist()):
        own = scaled[axis == a]
        scatter = own.std(ddof=1) if len(own) > 1 else 0.0
        scaled[axis == a] = (own - own.mean()) / (scatter or 1.0)
    place = np.empty(len(scaled))
    place[np.argsort(scaled, kind="stable")] = (np.arange(len(scaled)) + 0.5) / max(len(scaled), 1)
    return np.array([NormalDist().inv_cdf(each) for each in place]), scaled
