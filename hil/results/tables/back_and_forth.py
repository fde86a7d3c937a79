"""Friction of an estimate from axes that move back and forth by themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.results.rounding import significant, uncertain
from hil.results.tables.table import Column, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.estimation.back_and_forth.result import BackAndForthFit, CurvePoint, FrictionCurve
    from hil.friction.law import TermValue
    from hil.model.robot import Robot
    from hil.results.tables.table import Row


def curves(fit: BackAndForthFit) -> Table:
    """Friction of each axis over its speed."""
    return Table(
        title="Friction over the speed",
        columns=(
            Column("axis"),
            *figures("speed, rad/s or m/s", "friction, N m or N", "± 95 %", "pairs"),
        ),
        parts=tuple(
            Part(tuple(_point(curve, point) for point in curve.points)) for curve in fit.curves
        ),
        explanation=(
            "Half the difference of the torques forth and back at the same position, less the rigid"
            " bodies' part of it. Mean over the pairs of strokes; the interval is that of the mean"
            " and comes from the scatter between pairs, drift included."
        ),
    )


def _point(curve: FrictionCurve, point: CurvePoint) -> Row:
    speed, pairs, half = significant(point.speed, 3), str(point.pairs), point.half_width
    if half is None:
        return str(curve.axis), speed, significant(point.friction, 3), "", pairs
    return str(curve.axis), speed, *uncertain(point.friction, half), pairs


def plain(fit: BackAndForthFit, robot: Robot) -> Table:
    """What classical laws would be, and what differs by direction."""
    return table(
        "Friction in the usual terms, for comparison",
        (
            "axis",
            Column("as offset, Coulomb and viscous alone", folds=True),
            Column("the same forth and back, and no rigid body's", folds=True),
        ),
        (_plain(robot, curve) for curve in fit.curves),
        "The first by least squares over samples at all speeds, base parameters given. The"
        " second is part of the fit: a constant, which may be an offset of the torque, and a"
        " part that grows with the speed. Torque ripple is not listed.",
    )


def _plain(robot: Robot, curve: FrictionCurve) -> Row:
    axis = curve.axis - 1
    unit = robot.torque_unit(axis)
    units = {"viscous": f"{unit} s/{robot.position_unit(axis)}"}
    classical = [
        f"{name} {_value(term)} {units.get(name, unit)}" for name, term in curve.plain.items()
    ]
    constant, per_speed = curve.by_direction
    even = f"{_value(constant)} {unit}, {_value(per_speed)} {units['viscous']}"
    return str(curve.axis), ", ".join(classical), even


def _value(term: TermValue) -> str:
    return " ± ".join(uncertain(term.value, term.standard_error))


def statements(fit: BackAndForthFit) -> Iterator[str]:
    """What was chosen, what was not identified, and what restricts the estimate."""
    low, high = (f"{each:.3g}" for each in fit.cut_off)
    cut_off = low if low == high else f"{low} to {high}"
    yield (
        f"{fit.pairs} pairs of strokes; friction is any odd function of the velocity, of each pair"
        f" its own; cut-off {cut_off} Hz ({fit.cut_off_reason})"
    )
    if fit.not_identified:
        yield (
            f"not identified: {', '.join(fit.not_identified)}, zero in the model; it holds for one"
            " axis that moves by itself at configurations like the recorded ones. Couplings show"
            " where several axes move: import such recordings as free motions"
        )
    if fit.combinations:
        sums = "; ".join(f"{each.name} for {each.stands_for}" for each in fit.combinations)
        yield f"identified as sums with these: {sums}"
    yield from fit.remarks
