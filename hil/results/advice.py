"""What in a result needs attention, and what to measure to mend it.

Every piece of advice names a figure and a remedy that can be carried out. Which measurement would
help a weak parameter most is calculated: with W of eq. (17), rows weighted by eq. (16), one more
row w lowers the parameter's variance G_kk, G = (W'W)^-1, by (G w)_k^2 / (1 + w' G w); the best row
among those already measured is named, to be measured again or in its neighbourhood.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.causes import CauseName
from hil.least_squares.solving import inverse
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.prediction.identifiability import group_observations
from hil.results.rounding import signed, unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.results.error_term import ErrorTerm
    from hil.results.prediction import Prediction
    from hil.runs.recording_file import Measured

    Array = NDArray[np.float64]

UNCERTAIN = 0.005
"""Standard error of a parameter, as a share of some joint's torque, above which it is too much."""
FEW_ROWS = 3
"""Measurements that a group should have for each of its parameters."""
CORRELATED = 0.9
"""Correlation from which on two parameters count as hard to distinguish."""
CONDITION = 100.0
"""Condition number above which a group is badly excited."""
OUTLIER = 4.0
"""Scatter inside a measurement over that of its axis's others from which on it stands out."""
MISFIT = 0.01
"""Residual of an axis's local models over its torque limit from which on it is more than noise."""
OFFSET = 4.0
"""Mean deviation of half-sums over its standard error that betrays an offset."""


@dataclass(frozen=True, slots=True)
class Advice:
    """One weakness.

    Attributes
    ----------
    subject : str
        Parameter, axis or measurement.
    what : str
        The finding, with its figure.
    remedy : str
        What to do about it.
    urgent : bool
        Whether to do it is advised; if not, it is a note.
    """

    subject: str
    what: str
    remedy: str
    urgent: bool = True


def advice(
    estimate: Estimate,
    prediction: Prediction,
    budget: Sequence[ErrorTerm],
    robot: Robot,
    plan: Plan,
    campaign: Sequence[Measured],
) -> tuple[Advice, ...]:
    """Judge a result and the measurements behind it; those of `plan` not in `campaign` miss.

    Weak parameters are those whose uncertainty shows in the torques of a free motion.
    """
    return (
        *_causes(budget),
        *_campaign(estimate, plan, campaign),
        *_outliers(estimate, robot),
        *_misfit(estimate, robot),
        *_groups(estimate, robot),
        *_parameters(estimate, prediction, robot, plan),
        *_correlations(estimate, robot),
        *_drives(robot),
        *_offsets(estimate, robot),
    )


def _campaign(estimate: Estimate, plan: Plan, campaign: Sequence[Measured]) -> Iterator[Advice]:
    measured_ids = {measured.measurement.id for measured in campaign}
    missing = [m.id for m in plan.measurements if m.id not in measured_ids]
    if missing:
        what = f"{len(missing)} of {len(plan.measurements)} planned measurements are missing"
        yield Advice(_listed(missing), what, "finish the run with hil run … --resume")
    for left in estimate.left_out:
        yield Advice(left.id, f"left out: {left.reason}", "move its recording away and --resume")
    for measured in (m for m in campaign if m.findings):
        findings = "; ".join(finding.message for finding in measured.findings)
        yield Advice(
            measured.measurement.id,
            f"kept with findings after {measured.attempts} attempts: {findings}",
            "mend the cause, move its recording away and --resume",
        )


def _causes(budget: Sequence[ErrorTerm]) -> Iterator[Advice]:
    """Causes of error, the largest first; those taken into account are notes."""
    for term in budget:
        if term.accounted:
            what = f"{term.cause}: {term.found}; ignored, {100 * term.share:.0f} % of the error"
        else:
            what = f"{term.cause}: {term.found}; {100 * term.share:.0f} % of the error"
        subject = _axes(term.axes) if term.axes else "all axes"
        yield Advice(subject, what, term.remedy, urgent=not term.accounted)


def _axes(axes: Sequence[int]) -> str:
    """Name axes, counted from 1."""
    return _listed([f"axis {axis}" for axis in axes])


def _outliers(estimate: Estimate, robot: Robot) -> Iterator[Advice]:
    """Measurements whose local model leaves far more than it does in others of their kind."""
    elements = {(v.kind, v.axis, v.partner) for v in estimate.local}
    for kind, axis, partner in sorted(elements):
        alike = [v for v in estimate.local if (v.kind, v.axis, v.partner) == (kind, axis, partner)]
        usual = float(np.median([v.residual for v in alike]))
        for value in (v for v in alike if v.residual > OUTLIER * usual > 0):
            yield Advice(
                value.id,
                f"scatters by {value.residual:.2g} {robot.torque_unit(axis)},"
                f" {value.residual / usual:.0f} times as much as {kind} measurements of axis"
                f" {axis + 1} do",
                "look for a cause (contact, saturation, a cable), move its recording away and"
                " --resume",
            )


def _misfit(estimate: Estimate, robot: Robot) -> Iterator[Advice]:
    """Axes whose local models leave more than noise would."""
    share = np.nan_to_num(estimate.residual / robot.torque_limit)
    axes = np.flatnonzero(share > MISFIT)
    if axes.size:
        left = ", ".join(f"{100 * share[axis]:.1f} %" for axis in axes)
        yield Advice(
            _axes((axes + 1).tolist()),
            f"local models leave {left} of the torque limit: something is not modelled, and neither"
            " standard errors nor hil diagnose know of it",
            "look in recordings for torques that ring after the corners of a motion, and for"
            " encoders of few increments, whose accelerations are noise",
        )


def _groups(estimate: Estimate, robot: Robot) -> Iterator[Advice]:
    base = base_parameters(robot)
    for kind, row in ELEMENT_KINDS.items():
        members = [k for k in base.groups[row.group] if not base.dependencies.hidden[k]]
        names = ", ".join(base.names[k] for k in members)
        rows = sum(value.kind == kind for value in estimate.local)
        if not rows:  # trajectories identify the group
            continue
        if members and rows < FEW_ROWS * len(members):
            yield Advice(names, f"{rows} {kind} measurements for {len(members)} parameters",
                         f"at least {FEW_ROWS * len(members)} {kind} measurements")  # fmt: skip
        if members and estimate.condition[row.group] > CONDITION:
            yield Advice(names, f"condition number {estimate.condition[row.group]:.3g}",
                         f"{kind} measurements that vary more joints")  # fmt: skip


def _parameters(
    estimate: Estimate, prediction: Prediction, robot: Robot, plan: Plan
) -> Iterator[Advice]:
    base = base_parameters(robot)
    effect = np.nan_to_num(prediction.relative_effect)
    for k, name in enumerate(base.names):
        joint = int(np.argmax(effect[:, k]))
        if effect[joint, k] > UNCERTAIN:
            what = (
                f"its standard error, {estimate.standard_error[k]:.2g} {unit(base.units[k])}, is"
                f" {100 * effect[joint, k]:.2g} % of the torque of joint {joint + 1}"
            )
            yield Advice(name, what, _best_measurement(robot, plan, k))


def _best_measurement(robot: Robot, plan: Plan, k: int) -> str:
    """Which of the plan's measurements would lower the variance of parameter k most, if doubled."""
    sought = base_parameters(robot).dependencies.sought()
    # a parameter that is hidden from g(q) stands in two groups, of which the second shows it
    kind, group = [
        (kind, row.group) for kind, row in ELEMENT_KINDS.items() if k in sought[row.group]
    ][-1]
    candidates = [m for m in plan.measurements if m.kind == kind]
    if not candidates:
        return f"{kind} measurements, of which there are none (hil plan chooses them)"
    W = group_observations(plan, robot, group, sought[group])
    G = inverse(W.T @ W)
    at = sought[group].index(k)
    gains = (W @ G[:, at]) ** 2 / (1.0 + np.einsum("ij,jk,ik->i", W, G, W)) / G[at, at]
    best = candidates[int(np.argmax(gains))]
    return (
        f"more {kind} measurements of {best.axes_in_words}, such as {best.id}"
        f" (each lowers the variance by {100 * gains.max():.0f} %)"
    )


def _correlations(estimate: Estimate, robot: Robot) -> Iterator[Advice]:
    names = base_parameters(robot).names
    found = estimate.correlation
    for i, j in np.argwhere(np.triu(np.abs(found) > CORRELATED, 1)):
        size = signed(f"{found[i, j]:.2f}")
        yield Advice(
            f"{names[i]}, {names[j]}",
            f"correlation {size}: more certain together than apart",
            "configurations in which they act differently (hil robot shows where they occur)",
        )


def _drives(robot: Robot) -> Iterator[Advice]:
    stated = {
        "torque constants": robot.torque_constant_uncertainty,
        "rotor inertias": robot.rotor_inertia_uncertainty,
    }
    exact = [what for what, uncertainty in stated.items() if not uncertainty.any()]
    if exact:
        yield Advice(
            " and ".join(exact),
            "taken as exact; their errors shift parameters, show in no residual and are not in the"
            " intervals",
            "state their uncertainty in the robot file to have it carried to the parameters",
            urgent=False,
        )


def _offsets(estimate: Estimate, robot: Robot) -> Iterator[Advice]:
    """Half-sums that miss the model by the same amount everywhere, if that is no cause of error."""
    if any(cause.name == CauseName.ASYMMETRY for cause in estimate.causes):
        return
    found = {}
    gravity = [v for v in estimate.local if v.symbol == "g"]
    for axis in sorted({v.axis for v in gravity}):
        left = np.array([v.value - v.model for v in gravity if v.axis == axis])
        if len(left) > 2 and abs(left.mean()) > OFFSET * left.std(ddof=1) / np.sqrt(len(left)):
            shift = f"{signed(f'{left.mean():.2f}')} {robot.torque_unit(axis)}"
            found[f"axis {axis + 1}"] = shift
    if found:
        yield Advice(
            ", ".join(found),
            f"half-sums are off by {', '.join(found.values())} on average: friction differs by"
            " direction, or the current sensor has an offset",
            "nothing, as the improved method fits it; it shifts the published one's parameters",
            urgent=False,
        )


def _listed(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (" …" if len(names) > most else "")
