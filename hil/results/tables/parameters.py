"""Tables of base parameters, torques and drive trains with uncertainty; comparison of methods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.drive_train import compliance_units
from hil.estimation.simultaneous import SIGNIFICANT
from hil.model.base_parameters import base_parameters
from hil.show.rounding import count, percent, rounded, signed, significant, uncertain, unit
from hil.show.table import Column, Marked, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.residual import BandResidual
    from hil.show.table import Row


DISAGREEMENT = 3.0
"""Largest unmarked difference between two methods [standard errors]."""
NAMED = Column("", symbols=True), Column("meaning", folds=True)
"""First columns of a table of base parameters."""
NOT_IDENTIFIED = "not identified"
IN_FULL = "95 % interval", "d.o.f."
EXPLANATION = (
    "Values with standard errors, and intervals of 95 % with their effective degrees of freedom"
    " (d.o.f.)."
)


def parameters(model: IdentifiedRobot, *, in_full: bool = False) -> Table:
    """Return the table of base parameters with uncertainties, by group.

    The full table, for pages, has the ends of the intervals, and their degrees of freedom.
    """
    base, origin, condition = base_parameters(model.robot), model.provenance, model.condition
    measured = count(origin.measurements, "measurement")

    def conditioned(title: str, group: str) -> str:
        number = f", condition number {condition[group]:.3g}" if group in condition else ""
        return f"{title}{number}"

    return table(
        conditioned(f"{model.robot.name}: {measured}, {origin.method} method", "all"),
        (
            *NAMED,
            *figures("value", "std. error", *(IN_FULL if in_full else ("± 95 %",)), "error, %"),
            "unit",
            Column("expression", folds=True, symbols=True),
        ),
        (
            Part(
                tuple(_parameter(model, k, in_full) for k in members),
                conditioned(group.replace("_", "-"), group),
            )
            for group, members in base.groups.items()
            if members
        ),
        EXPLANATION if in_full else "",
        () if model.prior is None else (str(model.prior),),
    )


def _parameter(model: IdentifiedRobot, k: int, in_full: bool) -> Row:
    base = base_parameters(model.robot)
    if not model.identified[k]:
        empty = [""] * (4 if in_full else 3)
        named = base.names[k], base.meanings[k]
        return (*named, NOT_IDENTIFIED, *empty, unit(base.units[k]), base.expressions[k])
    value, error = float(model.values[k]), float(model.standard_errors[k])
    low, high = (float(end) for end in model.interval()[k])
    total, name = model.details.sum_of(base.names[k]), base.names[k]
    prior = " (prior)" if model.prior and name in model.prior.replaced else ""
    ends = f"{rounded(low, error)} … {rounded(high, error)}", f"{model.degrees_of_freedom[k]:.1f}"
    return (
        f"{name} + …" if total else f"{name}{prior}",
        base.meanings[k],
        *uncertain(value, error),
        *(ends if in_full else (rounded((high - low) / 2, error),)),
        percent(error, value),
        unit(base.units[k]),
        total or base.expressions[k],
    )


def methods(model: IdentifiedRobot, check: IdentifiedRobot) -> Table:
    """Return two models of a run side by side, with differences beyond `DISAGREEMENT` marked."""
    heads = model.method, "std. error", check.method, "std. error", "difference", "in std. errors"
    return table(
        f"{model.robot.name}: {model.method} and {check.method} method",
        (*NAMED, "unit", *figures(*heads)),
        (
            Part(tuple(_method(model, check, k) for k in members))
            for members in base_parameters(model.robot).groups.values()
            if members
        ),
    )


def _method(model: IdentifiedRobot, check: IdentifiedRobot, k: int) -> Row:
    difference = float(check.values[k] - model.values[k])
    errors = float(model.standard_errors[k]), float(check.standard_errors[k])
    ratio = difference / math.hypot(*errors)
    shown = signed(f"{ratio:.1f}")
    return (
        model.names[k],
        base_parameters(model.robot).meanings[k],
        unit(model.units[k]),
        *uncertain(float(model.values[k]), errors[0]),
        *uncertain(float(check.values[k]), errors[1]),
        rounded(difference, errors[1]),
        Marked(shown) if abs(ratio) > DISAGREEMENT else shown,
    )


def residuals(model: IdentifiedRobot) -> Table:
    """Return the residuals of the axes' torques, in the terms of the method."""
    unit = model.robot.torque_units
    each = zip(model.residual.tolist(), model.robot.torque_limit.tolist(), strict=True)
    return table(
        "Residual torque of the fit",
        ("axis", *figures(f"limit, {unit}", f"rms, {unit}", "% of limit")),
        (
            (str(axis), f"{limit:g}", "not measured", "")
            if math.isnan(left)
            else (str(axis), f"{limit:g}", significant(left, 3), percent(left, limit))
            for axis, (left, limit) in enumerate(each, start=1)
        ),
        "Root mean square of the low-passed residual, with friction fitted anew in each "
        "measurement.",
    )


def band_residual(found: BandResidual | None, robot: Robot, what: str) -> Table:
    """Return the residual over the fixed band of `hil.results.residual`; no rows if unknown.

    Parameters
    ----------
    what : str
        Recordings, for the title.
    """
    if found is None:
        return table("", (), ())
    columns = zip(
        found.torque, found.left, found.relative.tolist(), found.relative_smoothed.tolist(),
        found.relative_unfiltered.tolist(), strict=True,
    )  # fmt: skip
    rows = [
        (
            str(axis),
            f"{significant(torque, 3)} {robot.torque_unit(axis - 1)}",
            f"{significant(left, 3)} {robot.torque_unit(axis - 1)}",
            *("" if math.isnan(each) else significant(100 * each, 2) for each in shares),
        )
        for axis, (torque, left, *shares) in enumerate(columns, start=1)
        if torque is not None and left is not None
    ]
    together = (found.overall, np.nan, found.overall_unfiltered)
    shares = ("" if math.isnan(each) else significant(100 * each, 2) for each in together)
    return table(
        f"Residual torque {what}, up to {found.band:g} Hz",
        ("axis", *figures("torque", "residual", "residual, %", "in motion, %", "unfiltered, %")),
        (*rows, ("all", "", "", *shares)),
        "Root mean squares of the torque and of measured less predicted torque, positions and "
        "torques low-passed alike (Butterworth, order 4, zero phase). In motion: without rest, "
        "and with the prediction low-passed too, so that friction has no jump at a reversal; "
        "models are judged by this column. Unfiltered: of the torque as recorded.",
    )


def drive_train(estimate: Estimate) -> Table:
    """Return the measured drive train of each axis; no rows without an estimate.

    Compliances and friction of the load are marked if the estimate takes them into account.
    """
    compliance = f"compliance, {compliance_units(estimate.robot)}"
    heads = "lag, ms", "±", compliance, "±", "load friction, %", "±"
    return table("Drive trains, with standard errors", ("axis", *figures(*heads)), _axes(estimate))


def _axes(estimate: Estimate) -> Iterator[Row]:
    train, load = estimate.drive_train, estimate.load_friction
    if train is None:
        return
    mu = np.full((2, len(train.lag)), np.nan) if load is None else np.array(load)
    for axis in range(len(train.lag)):
        yield (
            str(axis + 1),
            *_figure(1e3 * train.lag[axis], 1e3 * train.lag_error[axis]),
            *_figure(
                1e6 * train.compliance[axis], 1e6 * train.compliance_error[axis], train.soft[axis]
            ),
            *_figure(1e2 * mu[0, axis], 1e2 * mu[1, axis], mu[0, axis] > SIGNIFICANT * mu[1, axis]),
        )


def _figure(value: float, error: float, marked: bool = False) -> tuple[str | Marked, str]:
    if math.isnan(error):
        return "not identifiable", ""
    shown, of_error = uncertain(float(value), float(error))
    return (Marked(shown) if marked else shown), of_error
