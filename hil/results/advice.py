"""Limits of a result: causes of its error, and remedies by measurement or repair.

The effect of a cause on the base parameters (`hil.estimation.excluded.effects`) is converted to the
torques of a free motion, which makes all causes comparable. The squares of these torques are added
to the square of the scatter, which is noise and wandering friction. A cause that the estimation
accounts for counts with the error without its compensation. A cause is named if its share of the
sum is large enough. A notable scatter that the causes do not explain is named as a further cause:
the motion hardly excites some parameters, or the measurements disagree more than noise explains.

Every piece of advice names a figure and a practicable remedy. An advised remedy makes the result
doubtful; a note leaves the result good. The measurement that improves a weak parameter most is
calculated: with W of eq. (17), rows weighted by eq. (16), one more row w lowers the parameter's
variance G_kk, G = (W'W)^-1, by (G w)_k^2 / (1 + w' G w). The advice is to repeat the measurement
with the best row, or to measure in its neighbourhood.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from drivers.drive_bus import SampleFlag
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.effects import Effect, effects
from hil.estimation.excluded.result import ErrorTerm
from hil.estimation.free_motion.result import POOR
from hil.estimation.friction.points import judge_local_values
from hil.estimation.intervals import SIGNIFICANT
from hil.least_squares.solving import inverse
from hil.measuring.checks.recording_checks import UNTIMED
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import ELEMENT_KINDS
from hil.planning.prediction.identifiability import group_observations
from hil.results.judgement import FEWEST, NOTABLE, Reservation, doubtful, good, reservations
from hil.results.prediction import FreeTorques
from hil.show.rounding import signed, significant, unit
from hil.show.table import Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.planning.plan import Plan
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.judgement import Rule
    from hil.runs.recording_file import Measured

UNLIKE = "friction that differs by direction"


def error_budget(estimate: Estimate) -> tuple[ErrorTerm, ...]:
    """Return the significant causes of error, the largest first.

    Empty if noise explains the whole error, and for methods that test no causes.
    """
    if estimate.joint is None:
        return ()
    robot, free = estimate.robot, FreeTorques(estimate.robot)
    rms = free.rms(estimate.values)

    def relative(torques: Array) -> float:
        return float(np.mean(torques[rms > 0] / rms[rms > 0]))

    def scatter(covariance: Array) -> float:
        return relative(free.standard_error(covariance))

    every = list(effects(robot, estimate.joint, estimate.local, estimate.scatter_covariance))
    explained = [scatter(each.covariance) for each in every]
    torques = [
        float(np.hypot(relative(free.rms(each.change)), own))
        for each, own in zip(every, explained, strict=True)
    ]
    square = sum(own**2 for own in explained)
    rest = float(np.sqrt(max(0.0, scatter(estimate.scatter_covariance) ** 2 - square)))
    if rest > NOTABLE and rest**2 > square:
        n, none = len(estimate.values), np.zeros_like(estimate.values)
        # weak excitation if white noise explains more than a quarter of the scatter: varying
        # friction scatters torques up to four times as much as white noise of equal size
        weak = scatter(estimate.joint.solver.noise_covariance[:n, :n]) > 0.25 * rest
        cause = "weak excitation" if weak else "measurements that disagree"
        detail = f"torques are uncertain by {100 * rest:.2g} %"
        every.append(Effect(cause, (), detail, none, estimate.scatter_covariance))
        torques.append(rest)
        rest = 0.0
    total = rest**2 + sum(torque**2 for torque in torques)
    # minimum share of a named cause in the sum of squares: 0.1, which is a third of the error
    terms = [
        ErrorTerm(
            cause=each.cause, axes=tuple(axis + 1 for axis in each.axes), found=each.detail,
            torque=torque, share=torque**2 / total, accounted=CAUSES[each.cause].accounted,
        )
        for each, torque in zip(every, torques, strict=True)
        if torque**2 > 0.1 * total
    ]  # fmt: skip
    return tuple(sorted(terms, key=lambda term: -term.share))


def budget_table(terms: Sequence[ErrorTerm]) -> Table:
    """Return the actual and possible causes of error; no rows if noise is the only cause."""
    return table(
        "Largest causes of error",
        ("cause", "axes", *figures("torque, %", "share, %"), "accounted for"),
        (
            (
                term.cause,
                ", ".join(map(str, term.axes)) or "all",
                significant(100 * term.torque, 2),
                f"{100 * term.share:.0f}",
                "yes" if term.accounted else "no",
            )
            for term in terms
        ),
        "Torque: error of the torques on a free motion by this cause. Share: part of the sum of "
        "the squared errors; the remainder is noise. For a cause accounted for: error without "
        "compensation.",
    )


TIMELY = 0.01
"""Share of samples at uncertain instants above which a note is given."""


class CampaignResult(NamedTuple):
    """Result with its measurements.

    Attributes
    ----------
    effect : ndarray, shape (n_joints, n_base)
        Effect of the parameters' errors on the torques of a free motion (`effect_of_errors`).
    measured : sequence of Measured
        Finished measurements of the plan.
    """

    model: IdentifiedRobot
    effect: Array
    plan: Plan
    measured: Sequence[Measured]


def advice(campaign: CampaignResult) -> tuple[Reservation, ...]:
    """Judge a result with its measurements."""
    return tuple(reservations(RULES, campaign))


def _measured(campaign: CampaignResult) -> Iterator[Reservation]:
    planned, resume = (
        campaign.plan.measurements,
        ("move the recording to another folder and continue with --resume"),
    )
    measured_ids = {measured.measurement.id for measured in campaign.measured}
    missing = [m.id for m in planned if m.id not in measured_ids]
    if missing:
        what = f"{len(missing)} of {len(planned)} planned measurements are missing"
        yield doubtful(what, "finish the run with hil run … --resume", _listed(missing))
    for left in campaign.model.left_out:
        yield doubtful(f"left out: {left.reason}", resume, left.id)
    for measured in (m for m in campaign.measured if m.findings):
        findings = "; ".join(finding.message for finding in measured.findings)
        yield doubtful(
            f"kept with findings after {measured.attempts} attempts: {findings}",
            f"remove the cause, {resume}",
            measured.measurement.id,
        )


def _causes(campaign: CampaignResult) -> Iterator[Reservation]:
    """Yield causes of error, the largest first; causes taken into account are notes."""
    for term in campaign.model.error_budget:
        share = f"{100 * term.share:.0f} % of the error"
        what = f"{term.cause}: {term.found}; {'if ignored, ' if term.accounted else ''}{share}"
        subject = _axes(term.axes) if term.axes else "all axes"
        yield (good if term.accounted else doubtful)(what, term.remedy, subject)


def _axes(axes: Sequence[int]) -> str:
    """Name axes, counted from 1."""
    return _listed([f"axis {axis}" for axis in axes])


def _timing(campaign: CampaignResult) -> Iterator[Reservation]:
    """Yield doubts about instants that are uncertain because the computer was late."""
    flags = [np.any(m.recording.flags & SampleFlag.UNTIMED, axis=1) for m in campaign.measured]
    share = float(np.concatenate(flags).mean()) if flags else 0.0
    if share > TIMELY:
        yield (doubtful if share > UNTIMED else good)(
            f"{share:.1%} of all samples have uncertain time stamps, because this computer sent "
            "SYNC late, and are left out",
            "stop other programs, use --realtime or sample more slowly, and measure anew",
            "timing",
        )


def _outliers(campaign: CampaignResult) -> Iterator[Reservation]:
    """Yield outliers: measurements with an unusually large residual for their kind and axis."""
    local = campaign.model.local
    for kind, axis, partner in sorted({(v.kind, v.axis, v.partner) for v in local}):
        alike = [v for v in local if (v.kind, v.axis, v.partner) == (kind, axis, partner)]
        usual = float(np.median([v.residual for v in alike]))
        # minimum ratio of an outlier's residual to the median of equal measurements. In the whole
        # campaign of benchmarks/golden.py, without any fault, the largest ratio is 2.8
        for value in (v for v in alike if v.residual > 4.0 * usual > 0):
            yield doubtful(
                f"residual {value.residual:.2g} {campaign.model.robot.torque_unit(axis)}, "
                f"{value.residual / usual:.0f} times the usual residual of {kind} measurements "
                f"of axis {axis + 1}",
                "look for a cause (contact, saturation, a cable), move the recording to another "
                "folder and continue with --resume",
                value.id,
            )


def _misfit(campaign: CampaignResult) -> Reservation | None:
    """Return a doubt about axes with residuals of local models beyond the noise."""
    share = np.nan_to_num(campaign.model.residual / campaign.model.robot.torque_limit)
    axes = np.flatnonzero(share > NOTABLE)
    if not axes.size:
        return None
    left = ", ".join(f"{100 * share[axis]:.1f} %" for axis in axes)
    return doubtful(
        f"residual {left} of the torque limit within single measurements: an unmodelled effect, "
        "not included in standard errors and not tested by hil diagnose",
        "check the recordings for torque oscillations after corners of a motion, and for coarse "
        "encoders (noisy accelerations)",
        _axes((axes + 1).tolist()),
    )


def _groups(campaign: CampaignResult) -> Iterator[Reservation]:
    base, estimate = base_parameters(campaign.model.robot), campaign.model
    for kind, row in ELEMENT_KINDS.items():
        members = [k for k in base.groups[row.group] if not base.dependencies.hidden[k]]
        names = ", ".join(base.titles[k] for k in members)
        rows = sum(value.kind == kind for value in estimate.local)
        if not rows or not members:  # trajectories identify the group
            continue
        needed, condition = FEWEST * len(members), estimate.condition[row.group]
        if rows < needed:
            what = f"{rows} {kind} measurements for {len(members)} parameters"
            yield doubtful(what, f"plan at least {needed} {kind} measurements", names)
        if condition > POOR:
            remedy = f"plan {kind} measurements that vary more joints"
            yield doubtful(f"condition number {condition:.3g}", remedy, names)


def _parameters(campaign: CampaignResult) -> Iterator[Reservation]:
    base, effect = base_parameters(campaign.model.robot), campaign.effect
    errors = campaign.model.standard_errors
    for k, name in enumerate(base.titles):
        joint = int(np.argmax(effect[:, k]))
        if effect[joint, k] > NOTABLE:
            yield doubtful(
                f"its standard error, {errors[k]:.2g} {unit(base.units[k])}, is"
                f" {100 * effect[joint, k]:.2g} % of the torque of joint {joint + 1}",
                _best_measurement(campaign.model.robot, campaign.plan, k),
                name,
            )


def _best_measurement(robot: Robot, plan: Plan, k: int) -> str:
    """Find the measurement of the plan whose repetition lowers the variance of parameter k most."""
    sought = base_parameters(robot).dependencies.sought()
    # a parameter hidden from g(q) belongs to two groups, and only the second identifies it
    kind, group = [
        (kind, row.group) for kind, row in ELEMENT_KINDS.items() if k in sought[row.group]
    ][-1]
    candidates = [m for m in plan.measurements if m.kind == kind]
    if not candidates:
        return f"add {kind} measurements; the plan has none (hil plan chooses them)"
    W = group_observations(plan, robot, group, sought[group])
    G = inverse(W.T @ W)
    at = sought[group].index(k)
    gains = (W @ G[:, at]) ** 2 / (1.0 + np.einsum("ij,jk,ik->i", W, G, W)) / G[at, at]
    best = candidates[int(np.argmax(gains))]
    return (
        f"add {kind} measurements of {best.axes_in_words}, such as {best.id}"
        f" (each lowers the variance by {100 * gains.max():.0f} %)"
    )


def _correlations(campaign: CampaignResult) -> Iterator[Reservation]:
    titles, found = base_parameters(campaign.model.robot).titles, campaign.model.correlation
    # at a correlation of 0.9 the standard error of a parameter is 1 / sqrt(1 - 0.9^2) = 2.3 times
    # its standard error if the other parameter is known
    for i, j in np.argwhere(np.triu(np.abs(found) > 0.9, 1)):
        yield doubtful(
            f"correlation {signed(f'{found[i, j]:.2f}')}: the sum or difference is more certain "
            "than each parameter",
            "add configurations in which these two have different effects (hil robot shows where "
            "each occurs)",
            f"{titles[i]}, {titles[j]}",
        )


def _drives(campaign: CampaignResult) -> Reservation | None:
    stated = {
        "torque constants": campaign.model.robot.torque_constant_uncertainty,
        "rotor inertias": campaign.model.robot.rotor_inertia_uncertainty,
    }
    exact = [what for what, uncertainty in stated.items() if not uncertainty.any()]
    if not exact:
        return None
    return good(
        "taken as exact; their errors shift parameters, but appear neither in residuals nor in "
        "intervals",
        "state their uncertainty in the robot file to include it in the intervals",
        " and ".join(exact),
    )


def _offsets(campaign: CampaignResult) -> Reservation | None:
    """Return a note on direction-dependent friction, unless already in the error budget."""
    if any(term.cause == UNLIKE for term in campaign.model.error_budget):
        return None
    tests = judge_local_values(campaign.model.local).items()
    found = {f"axis {axis + 1}": t.asymmetry for axis, t in tests if t.p_zero < SIGNIFICANT}
    if not found:
        return None
    shares = ", ".join(signed(f"{100 * share:.2g}") for share in found.values())
    return good(
        f"half-sums of both directions deviate by {shares} % of friction on average: friction "
        "differs by direction, or the current sensor has an offset",
        CAUSES[UNLIKE].remedy,
        ", ".join(found),
    )


RULES: tuple[Rule[CampaignResult], ...] = (
    _causes, _timing, _measured, _outliers, _misfit, _groups, _parameters, _correlations, _drives,
    _offsets,
)  # fmt: skip


def _listed(names: Sequence[str], most: int = 6) -> str:
    return ", ".join(names[:most]) + (" …" if len(names) > most else "")
