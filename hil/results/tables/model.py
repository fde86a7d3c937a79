"""Tables of an identified model, with remarks on its restrictions, by identification method.

Friction, residuals and choices of estimates from imported free motions and strokes.

For free motions friction is a law; for single-axis strokes it is a curve.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.estimate import MeasurementFit
from hil.estimation.free_motion.result import FreeMotionFit
from hil.friction.ripple import ripple_left_out
from hil.results.identified_robot import lacking
from hil.results.tables.friction import campaign_friction
from hil.results.tables.parameters import band_residual, parameters, residuals
from hil.show.outcome import Outcome
from hil.show.rounding import probability, significant, uncertain
from hil.show.table import Column, Part, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.estimation.back_and_forth.result import CurvePoint, FrictionCurve
    from hil.friction.law import AxisLaw, CoupledFriction, TermValue
    from hil.model.robot import Robot
    from hil.results.identified_robot import IdentifiedRobot
    from hil.show.table import Row


def friction(fit: FreeMotionFit, robot: Robot) -> Table:
    """Return the table of friction laws: coefficients and prediction errors of other laws."""
    return table(
        "Friction",
        (
            "axis",
            Column("law", folds=True),
            Column("coefficients with std. errors", folds=True),
            Column("only Coulomb and viscous", folds=True),
            Column("held-out error, other laws", folds=True),
        ),
        (*(_axis(robot, *each) for each in enumerate(fit.axes)), *map(_coupled, fit.coupled)),
        "Viscous friction per unit of velocity; other terms as torque or force at the reference "
        "speed, hardly ever exceeded by the axis. The simplest law is chosen unless another is "
        "significantly better on held-out blocks; held-out errors are relative to that of the "
        "law chosen. Presliding: distance over which friction changes sign after a reversal. "
        "Levels: friction at times spread evenly over the recording, relative to the mean. "
        "Torque ripple is not listed.",
    )


def _axis(robot: Robot, axis: int, law: AxisLaw) -> Row:
    position = robot.position_unit(axis)
    written = partial(_coefficient, law, robot.torque_unit(axis), position)
    others = (each for each in law.terms.items() if not each[0].startswith(("cosine", "sine")))
    named = [written(*each) for each in others]
    if law.presliding:
        named.append(f"presliding over {significant(law.presliding, 2)} {position}")
    if law.level:
        levels = ", ".join(significant(100 * each, 3) for each in law.level)
        named.append(f"level {levels} %")
    plain = ", ".join(written(*each) for each in law.plain.items())
    # the three best alternatives to the law, with their errors
    errors = sorted((error, name) for name, error in law.held_out.items() if name != law.law)
    best = ", ".join(f"{name} {significant(error, 4)}" for error, name in errors[:3])
    return str(axis + 1), law.law, ", ".join(named), plain, best


def _coefficient(law: AxisLaw, unit: str, position: str, term: str, value: TermValue) -> str:
    scale = 1.0 / law.speed if term == "viscous" else 1.0
    shown, error = uncertain(scale * value.value, scale * value.standard_error)
    unit = f"{unit} s/{position}" if term == "viscous" else "" if term == "load" else unit
    return f"{term} {shown} ± {error} {unit}".rstrip()


def _coupled(each: CoupledFriction) -> Row:
    parts = (
        f"{name} {' ± '.join(uncertain(term.value, term.standard_error))}"
        for name, term in (("Coulomb", each.coulomb), ("viscous", each.viscous))
    )
    motors = f"{each.motor} and {each.joint}"
    return motors, f"motor {each.motor}, coupled", ", ".join(parts), "", ""


def left_by_fit(model: IdentifiedRobot) -> Table:
    """Return the residuals of imports, axis by axis and of all axes together."""
    fit = model.details
    if isinstance(fit, MeasurementFit):
        return table("", (), ())
    free = isinstance(fit, FreeMotionFit)
    samples = "all samples" if free else "strokes without reversals"
    rows = [
        (str(axis), significant(left, 3), "" if share is None else significant(100 * share, 3))
        for axis, (left, share) in enumerate(
            zip(model.residual.tolist(), fit.relative_residual, strict=True), start=1
        )
        if np.isfinite(left)
    ]
    together = significant(float(np.sqrt(np.nansum(model.residual**2))), 3)
    return table(
        f"Residual torque of the fit, {samples}",
        ("axis", *figures(f"rms, {model.robot.torque_units}", "% of the torque")),
        (*rows, ("all", together, significant(100 * fit.overall_residual, 3))),
        "Root mean square of the low-passed residual, and ratio to that of the torque.",
    )


def statements(fit: FreeMotionFit) -> Iterator[str]:
    """Yield sentences on choices, tests and restrictions of the estimate."""
    zone = (
        f"samples slower than {100 * fit.dead_zone:g} % of an axis's speed were not fitted"
        if fit.dead_zone
        else "no dead zone"
    )
    yield (
        f"cut-off {fit.cut_off:.3g} Hz ({fit.cut_off_reason}), of torques {fit.band:.3g} Hz; {zone}"
    )
    n = len(fit.axes)
    alike: dict[tuple[bool, str], list[str]] = {}
    for axis, reason in enumerate(fit.velocity_reasons or ("",) * n, start=1):
        alike.setdefault((axis in fit.recorded_velocity, reason), []).append(str(axis))
    sources = []
    for (recorded, reason), axes in alike.items():
        which = f"axis {', '.join(axes)}" if len(axes) < n else "all axes"
        why = f" ({reason})" if reason else ""
        sources.append(f"{which} {'as recorded' if recorded else 'from the position'}{why}")
    yield f"velocity of {'; of '.join(sources)}"
    for axis, each in enumerate(fit.lag, start=1):
        if each.value:
            value, error = uncertain(1e3 * each.value, 1e3 * each.standard_error)
            yield (
                f"torque of axis {axis} recorded {value} ± {error} ms after the position; the "
                "lag is corrected, in residuals and predictions of recordings too"
            )
    for axis, soft in fit.compliance.items():
        value, error = uncertain(1e6 * soft.value, 1e6 * soft.standard_error)
        yield (
            f"compliance of axis {axis}: {value} ± {error} millionths of a rad/(N m) or m/N, "
            "used in residuals and predictions of recordings, not in model.torque"
        )
    for gain in fit.gains:
        value, error = uncertain(gain.value, gain.standard_error)
        yield (
            f"gain of axis {gain.axis}, unknown in the map: {value} ± {error} {gain.unit} for one"
            " unit of the signal"
        )
    if (test := fit.bias_test) is None:
        yield "too few blocks to test for a bias of least squares by noise of the positions"
    else:
        tested = (
            f"test of Durbin, Wu and Hausman, p {probability(test.p_value)}, at most"
            f" {test.shift:.2g} standard errors"
        )
        yield (
            f"noise of the positions biases least squares ({tested}): state a lower cut_off in "
            "the map, or use --method 'instrumental variables'"
            if test.biased
            else f"noise of the positions does not bias least squares ({tested})"
        )
    if fit.least_inertia > 0:
        yield "the mass matrix is positive definite along the motion"
    else:
        yield (
            "the mass matrix is not positive definite along the motion: these parameters cannot "
            "be simulated"
        )
    yield from fit.remarks


def curves(fit: BackAndForthFit, robot: Robot) -> Table:
    """Return the friction curves of the axes."""
    heads = f"speed, {robot.position_units}/s", f"friction, {robot.torque_units}"
    return table(
        "Friction over the speed",
        ("axis", *figures(*heads, "± 95 %", "pairs")),
        (Part(tuple(_point(curve, point) for point in curve.points)) for curve in fit.curves),
        "Half the difference of forward and backward torque at the same position, less that of "
        "the rigid bodies. Mean over the pairs of strokes, with its interval from the scatter "
        "between pairs, drift included.",
    )


def _point(curve: FrictionCurve, point: CurvePoint) -> Row:
    speed, pairs, half = significant(point.speed, 3), str(point.pairs), point.half_width
    if half is None:
        return str(curve.axis), speed, significant(point.friction, 3), "", pairs
    return str(curve.axis), speed, *uncertain(point.friction, half), pairs


def plain(fit: BackAndForthFit, robot: Robot) -> Table:
    """Return classical friction laws for comparison, and direction-dependent torques."""
    return table(
        "Friction in the usual terms, for comparison",
        (
            "axis",
            Column("only offset, Coulomb and viscous", folds=True),
            Column("equal in both directions, without rigid bodies", folds=True),
        ),
        (_plain(robot, curve) for curve in fit.curves),
        "Second column: least squares over samples at all speeds, with fixed base parameters. "
        "Third column, part of the fit: a constant, such as an offset of the torque, and a part "
        "that grows with speed. Torque ripple is not listed.",
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


def statements_of_strokes(fit: BackAndForthFit) -> Iterator[str]:
    """Yield sentences on choices, unidentified parameters and restrictions of the estimate."""
    low, high = (f"{each:.3g}" for each in fit.cut_off)
    cut_off = low if low == high else f"{low} to {high}"
    yield (
        f"{fit.pairs} pairs of strokes; friction: any odd function of the velocity, one for each "
        f"pair; cut-off {cut_off} Hz ({fit.cut_off_reason})"
    )
    if fit.not_identified:
        yield (
            f"not identified: {', '.join(fit.not_identified)}, zero in the model, which is valid "
            "for motion of a single axis at configurations like the recorded ones; to identify "
            "couplings, import free motions of several axes"
        )
    if fit.combinations:
        sums = "; ".join(f"{each.name} for {each.stands_for}" for each in fit.combinations)
        yield f"identified only as sums: {sums}"
    yield from fit.remarks


def summary(model: IdentifiedRobot) -> Outcome:
    """Return tables of parameters with uncertainties, of residuals and of unused measurements."""
    left = band_residual(model.band_residual, model.robot, "of these recordings")
    remarks = tuple(f"left out: {left}" for left in model.provenance.left_out)
    if model.prior is not None and model.prior.replaced:
        remarks = (str(model.prior), *remarks)
    if isinstance(fit := model.details, FreeMotionFit):
        own: tuple[Table, ...] = (friction(fit, model.robot),)
        remarks = (*statements(fit), *remarks)
    elif isinstance(fit, BackAndForthFit):
        own = curves(fit, model.robot), plain(fit, model.robot)
        remarks = (*statements_of_strokes(fit), *remarks)
    else:
        own = residuals(model), left, campaign_friction(model)
        ripple = ripple_left_out(model.robot) if model.method == "improved" else ""
        remarks = (*remarks, *filter(None, (lacking(model), ripple)))
    more = () if isinstance(fit, MeasurementFit) else (left_by_fit(model), left)
    if model.refinement is not None:
        more = (*more, model.refinement.table(model.robot))
    every = parameters(model), *own, *more
    return Outcome(tuple(each for each in every if each.parts), remarks)
