"""Friction and residuals of an estimate from axes that move back and forth by themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.results.rounding import rounded, significant, uncertain
from hil.results.tables.parameters import parameters
from hil.results.tables.table import Column, Part, Table, figures

if TYPE_CHECKING:
    from hil.estimation.back_and_forth.result import BackAndForthFit, CurvePoint, FrictionCurve
    from hil.friction.law import TermValue
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.tables.table import Row


def tables(model: IdentifiedRobot) -> tuple[Table, ...]:
    """All that is found of such motions."""
    return parameters(model), curves(model), plain(model), left_by_strokes(model)


def curves(model: IdentifiedRobot) -> Table:
    """Friction of each axis over its speed."""
    return Table(
        title="Friction over the speed",
        columns=(
            Column("axis"),
            *figures("speed, rad/s or m/s", "friction, N m or N", "± 95 %", "pairs"),
        ),
        parts=tuple(
            Part(tuple(_point(curve, point) for point in curve.points)) for curve in _curves(model)
        ),
        explanation=(
            "Half the difference of the torques forth and back at the same position, less the rigid"
            " bodies' part of it. Mean over the pairs of strokes; the interval is that of the mean"
            " and comes from the scatter between pairs, drift included."
        ),
    )


def _curves(model: IdentifiedRobot) -> tuple[FrictionCurve, ...]:
    return () if model.back_and_forth is None else model.back_and_forth.curves


def _point(curve: FrictionCurve, point: CurvePoint) -> Row:
    half = point.half_width
    friction = (
        (significant(point.friction, 3), "")
        if half is None
        else (rounded(point.friction, half), rounded(half, half))
    )
    return str(curve.axis), significant(point.speed, 3), *friction, str(point.pairs)


def plain(model: IdentifiedRobot) -> Table:
    """What classical laws would be, and what differs by direction."""
    rows = tuple(_plain(model, curve) for curve in _curves(model))
    return Table(
        title="Friction in the usual terms, for comparison",
        columns=(
            Column("axis"),
            Column("as offset, Coulomb and viscous alone", folds=True),
            Column("the same forth and back, and no rigid body's", folds=True),
        ),
        parts=(Part(rows),),
        explanation=(
            "The first by least squares over samples at all speeds, base parameters given. The"
            " second is part of the fit: a constant, which may be an offset of the torque, and a"
            " part that grows with the speed. Torque ripple is not listed."
        ),
    )


def _plain(model: IdentifiedRobot, curve: FrictionCurve) -> Row:
    axis = curve.axis - 1
    unit = model.robot.torque_unit(axis)
    units = {"viscous": f"{unit} s/{model.robot.position_unit(axis)}"}
    classical = [
        f"{name} {_value(term)} {units.get(name, unit)}" for name, term in curve.plain.items()
    ]
    constant, per_speed = curve.by_direction
    even = f"{_value(constant)} {unit}, {_value(per_speed)} {units['viscous']}"
    return str(curve.axis), ", ".join(classical), even


def _value(term: TermValue) -> str:
    return " ± ".join(uncertain(term.value, term.standard_error))


def left_by_strokes(model: IdentifiedRobot) -> Table:
    """Residuals of the samples that were used, axis by axis and of all axes together."""
    fit = model.back_and_forth
    if fit is None:
        return Table("", (), ())
    rows = [
        (str(axis + 1), significant(float(model.residual[axis]), 3), significant(100 * share, 3))
        for axis, share in enumerate(fit.relative_residual)
        if share is not None
    ]
    together = significant(float(np.sqrt(np.nansum(model.residual**2))), 3)
    rows.append(("all", together, significant(100 * fit.overall_residual, 3)))
    return Table(
        title="Torque left by the fit, strokes away from their reversals",
        columns=(Column("axis"), *figures("rms, N m or N", "% of the torque")),
        parts=(Part(tuple(rows)),),
        explanation="Root mean square of the residual after the low-pass, and over the torque's.",
    )


def statements(fit: BackAndForthFit) -> tuple[str, ...]:
    """What was chosen, what was not identified, and what restricts the estimate."""
    return (_settings(fit), *_not_identified(fit), *_combinations(fit), *fit.remarks)


def _settings(fit: BackAndForthFit) -> str:
    low, high = (f"{each:.3g}" for each in fit.cut_off)
    cut_off = low if low == high else f"{low} to {high}"
    return (
        f"{fit.pairs} pairs of strokes; friction is any odd function of the velocity, of each pair"
        f" its own; cut-off {cut_off} Hz ({fit.cut_off_reason})"
    )


def _not_identified(fit: BackAndForthFit) -> tuple[str, ...]:
    if not fit.not_identified:
        return ()
    return (
        f"not identified: {', '.join(fit.not_identified)}, zero in the model; it holds for one axis"
        " that moves by itself at configurations like the recorded ones. Couplings show where"
        " several axes move: import such recordings as free motions",
    )


def _combinations(fit: BackAndForthFit) -> tuple[str, ...]:
    if not fit.combinations:
        return ()
    sums = "; ".join(f"{each.name} for {each.stands_for}" for each in fit.combinations)
    return (f"identified as sums with these: {sums}",)
