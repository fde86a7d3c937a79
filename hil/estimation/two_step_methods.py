"""Identify base parameters from measurements by a two-step method.

published
    Section 6.1 of the paper: weighted least squares for p_g, then for p_Md with
    p_g compensated, then for p_Mod.
improved
    The condensed measurements of all kinds are summed and solved for all groups at once
    (`hil.estimation.simultaneous`). Torque lags and soft gears are estimated beforehand from the
    same measurements and compensated (`hil.estimation.drive_train`); the remaining uncertainty of
    lags and gears is added. Trajectories are used in addition to strokes, period by period.

Standard errors come from leaving out one measurement at a time (the jackknife of
`hil.least_squares.uncertainty`): they include any difference between measurements, noise, drift or
a misfit of the friction terms, without assumptions on these. If few measurements determine a
parameter, its standard error is itself uncertain, with fewer degrees of freedom.

Two errors are never visible in the data: those of the torque constants and of the rotor inertias.
If the robot file states their uncertainty, it is propagated to the parameters.

The published method follows eq. (14)-(18): gravity measurements give p_g. The moments of inertia,
less the contributions of p_g (and of the gravity torque during the measurement), give p_Md. The
coupling inertias, less the contributions of p_g and p_Md, give p_Mod. Each row is weighted with the
reciprocal of its axis's largest torque, eq. (16).

The whole chain is linear in the measured values, which is used twice: to leave a measurement out,
and to compute the effect of an error of a torque constant or of a rotor inertia.

Measurements must identify every base parameter before an estimate is accepted.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable
from hil.estimation.campaign_friction import campaign_friction
from hil.estimation.drive_train import CERTAIN, find_drive_train
from hil.estimation.estimate import Estimate, LeftOut, covariance_of_drives
from hil.estimation.free_motion.variants import DEFAULT
from hil.estimation.friction.points import history
from hil.estimation.local_fits import ELSEWHERE, believed_fit, local_fit
from hil.estimation.options import DEFAULTS, NUISANCES, Options
from hil.estimation.signals import signals
from hil.estimation.simultaneous import Joint, SimultaneousFit
from hil.friction.equation import place
from hil.friction.law import FrictionLaw
from hil.least_squares.balance import Kind, balance, propagate
from hil.least_squares.solving import IDENTIFIABLE, fitted, undetermined, undetermined_beside
from hil.least_squares.uncertainty import effective_degrees, jackknife
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import GROUPS
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import ELEMENT_KINDS, shows_element, shows_parameters
from hil.planning.prediction.identifiability import eliminate_others

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from hil.arrays import Array, Mask
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.local_fits import LocalFit, LocalValue
    from hil.estimation.signals import Prepared, Signals
    from hil.least_squares.regression import Fit
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion
    from hil.runs.recording import Recorded


BOUND = f"the condition number of their scaled columns exceeds {IDENTIFIABLE**-0.5:.0e}"
"""Reason for parameters not being identified."""


def conditions(
    robot: Robot, fits: Sequence[LocalFit], *, together: bool = True
) -> dict[str, float]:
    """Return the condition number of every measured group; infinite for a rank defect.

    Gravity parameters not determined by gravity alone are judged with the elements of M(q), unless
    `together` is False.
    """
    base = base_parameters(robot)
    condition: dict[str, float] = {}
    for group in GROUPS:
        columns = list(base.groups[group])
        rows = _rows(robot, fits, group)
        if not (columns and len(rows)):
            continue
        hidden = together and base.dependencies.hidden[columns].any()
        N, size = rows.T @ rows, None
        if hidden:
            # gravity elements of an axis are one kind, elements of M(q) the other
            of = [f.measurement for f in fits]
            axes = [m.index if ELEMENT_KINDS[m.kind].symbol == "g" else -1 for m in of]
            every = np.array([f.row / robot.torque_limit[f.measurement.index] for f in fits])
            N, size = eliminate_others(every, np.array(axes), columns)
        lost = undetermined(N, IDENTIFIABLE, size).any()
        condition[group] = np.inf if lost else float(np.sqrt(np.linalg.cond(N)))
    return condition


def _rows(robot: Robot, fits: Sequence[LocalFit], group: str) -> Array:
    """Return the observation matrix of a group, rows weighted by eq. (16)."""
    columns = list(base_parameters(robot).groups[group])
    kinds = _kinds(group)
    rows = [
        f.row[columns] / robot.torque_limit[f.measurement.index]
        for f in fits
        if f.measurement.kind in kinds
    ]
    return np.array(rows).reshape(len(rows), len(columns))


def _kinds(group: str) -> list[str]:
    return [name for name, kind in ELEMENT_KINDS.items() if kind.group == group]


def require_all_groups(robot: Robot, fits: Sequence[LocalFit], condition: dict[str, float]) -> None:
    """Raise an error for groups not identified by the corresponding measurements.

    Raises
    ------
    NotIdentifiable
    """
    base = base_parameters(robot)
    for group in GROUPS:
        columns = base.groups[group]
        if columns and not np.isfinite(condition.get(group, np.inf)):
            names, found = ", ".join(base.names[c] for c in columns), len(_rows(robot, fits, group))
            why = "" if found < len(columns) else f": {BOUND}"
            raise NotIdentifiable(
                f"{found} usable {' and '.join(_kinds(group))} measurements do not identify "
                f"{names}{why}; measure more configurations of this kind (see: hil dry-run), or "
                "finish the run with --resume"
            )


class TwoStep:
    """Published step 2, over the local fits of step 1."""

    def __init__(self, robot: Robot, local: Sequence[LocalFit]) -> None:
        self._groups = base_parameters(robot).groups
        self._n_base = len(base_parameters(robot))
        self._n_joints = robot.n_joints
        self._group = np.array([ELEMENT_KINDS[f.measurement.kind].group for f in local])
        self._axis = np.array([f.measurement.index for f in local])
        self._weight = 1.0 / robot.torque_limit[self._axis]
        self._rows = np.array([f.row + f.sides[2:] for f in local])
        self._torque = np.array([f.sides[0] for f in local])
        self._motor = np.array([f.sides[1] for f in local])

    @property
    def n_measurements(self) -> int:
        """Number of measurements."""
        return len(self._group)

    def solve(self, without: int | None = None) -> Array:
        """Return the base parameters, shape (n_base,), optionally without a measurement."""
        used = np.ones(self.n_measurements, dtype=bool)
        if without is not None:
            used[without] = False
        return self._chain(self._torque - self._motor, used)

    def sensitivity(self) -> Array:
        """Return the change of p per relative change of torque constants, then rotor inertias."""
        everything = np.ones(self.n_measurements, dtype=bool)
        axes = range(self._n_joints)
        of_constants = [self._chain(self._torque * (self._axis == j), everything) for j in axes]
        of_rotors = [self._chain(-self._motor * (self._axis == j), everything) for j in axes]
        return np.array([*of_constants, *of_rotors]).T

    def _chain(self, values: Array, used: Mask) -> Array:
        """Fit the groups successively, less the contributions of preceding groups."""
        p = np.zeros(self._n_base)
        for group in GROUPS:
            columns = list(self._groups[group])
            if columns:
                rows = used & (self._group == group)
                weight = self._weight[rows]
                C = weight * (values[rows] - self._rows[rows] @ p)
                W = weight[:, np.newaxis] * self._rows[np.ix_(rows, columns)]
                p[columns] = fitted(W, C)
        return p


def fit_improved(robot: Robot, recorded: Recorded, options: Options = DEFAULTS) -> Estimate:
    """Identify base parameters of all groups at once, with drive trains compensated.

    Raises
    ------
    NotIdentifiable
        Base parameters are not excited by the measurements.
    """
    raw, unusable = prepare(recorded)
    robot = fill_reached_limits(robot, raw)
    return measured(robot, raw, unusable, joint(robot, raw, options.nuisance), options)[0]


def fit_published(robot: Robot, recorded: Recorded, _options: Options = DEFAULTS) -> Estimate:
    """Identify base parameters group by group as published; no option has an effect.

    Raises
    ------
    NotIdentifiable
        Base parameters are not excited by the measurements.
    """
    raw, unusable = prepare(recorded)
    robot = fill_reached_limits(robot, raw)
    streamed = [LeftOut(m.id, ELSEWHERE[m.kind]) for m, _ in raw if not shows_element(m)]
    fits, useless = local_fits(robot, raw)
    condition = conditions(robot, fits, together=False)
    require_all_groups(robot, fits, condition)
    solver = TwoStep(robot, fits)
    p = solver.solve()
    # leaving out one measurement at a time
    changes = np.array([solver.solve(without) for without in range(solver.n_measurements)]) - p
    return estimate_of(
        robot, "published", fits, condition, (*unusable, *streamed, *useless),
        solver.n_measurements, solver.sensitivity(), p,
        jackknife(changes), effective_degrees(changes**2),
    )  # fmt: skip


def joint(robot: Robot, raw: Prepared, nuisance: Collection[str] = NUISANCES) -> Joint:
    """Condense measurements to a joint regression, and estimate the drive trains.

    Parameters
    ----------
    nuisance : collection of str
        Subset of `NUISANCES` to be estimated; the others are taken as zero.
    """
    drive_train = restrict_drive_train(find_drive_train(robot, raw), nuisance)
    prepared = [(m, drive_train.applied(robot, s)) for m, s in raw]
    solver = first = SimultaneousFit(robot, prepared)
    mu, error = solver.load_friction
    loaded = np.nan_to_num(mu / error) > CERTAIN
    if drive_train.soft.any() or loaded.any():
        # transmitted torques, and the axes with load friction, are now known better than from
        # measurements of inertia alone; doubtful load friction would bias the lag, since few
        # measurements of inertia distinguish load friction from a lag
        known = replace(drive_train, p=solver.solve())
        drive_train = restrict_drive_train(find_drive_train(robot, raw, loaded, known), nuisance)
        drive_train = replace(drive_train, p=known.p)
        prepared = [(m, drive_train.applied(robot, s)) for m, s in raw]
        solver = SimultaneousFit(robot, prepared)
    return Joint(solver, drive_train, prepared, first.without_load_friction)


def restrict_drive_train(train: DriveTrain, nuisance: Collection[str]) -> DriveTrain:
    """Return the drive trains restricted to the requested nuisances."""
    none = np.zeros_like(train.lag)
    if "lag" not in nuisance:
        train = replace(train, lag=none, lag_error=none)
    if "compliance" not in nuisance:
        train = replace(train, soft=np.zeros_like(train.soft))
    if not {"lag", "compliance"} <= set(nuisance):
        # without an estimate, a nuisance has no error in the covariance
        train = replace(train, covariance=np.zeros_like(train.covariance))
    return train


def measured(
    robot: Robot,
    raw: Prepared,
    unusable: Sequence[LeftOut],
    found: Joint,
    options: Options,
    imported: Sequence[Kind] = (),
) -> tuple[Estimate, Fit]:
    """Estimate from measurements, and optionally imports; return the fit as well.

    Parameters
    ----------
    raw : sequence of (ParameterMotion, Signals)
        Measurements without compensation of the drive trains.
    found : Joint
        Joint regression of the measurements.
    imported : sequence of Kind
        Regressions of imports.

    Raises
    ------
    NotIdentifiable
        Base parameters are neither determined by the recordings nor known by a prior.
    """
    solver, drive_train, names = found.solver, found.drive_train, base_parameters(robot).names
    fits, useless = local_fits(robot, found.prepared)
    condition, n = conditions(robot, fits), len(names)
    change, beside = doubt(robot, raw, drive_train, solver)
    own = Kind(solver.regression, effect=solver.sensitivity())
    whole, (share, *_) = balance([own, *imported], names)
    if options.prior is None:
        if not (imported or any(m.streamed for m, _ in raw)):
            # parameters excited by noise alone are not identified
            require_all_groups(robot, fits, condition)
        too = " together with the imports" if imported else ""
        what = f"{solver.n_measurements} usable measurements{too}"
        names = base_parameters(robot).names
        lost = undetermined_beside(whole.regression.normal.information, len(names))
        if lost.any():
            listed = ", ".join(name for name, each in zip(names, lost, strict=True) if each)
            raise NotIdentifiable(
                f"{what} do not identify {listed}: {BOUND}; measure more configurations (see: hil"
                " dry-run), or finish the run with --resume"
            )
    fit, prior_share = whole.regression.fit(options.covariance, whole.cells), None
    p, scatter = fit.x[:n] + share @ change, fit.covariance[:n, :n]
    covariance = scatter + whole.beside + propagate([share], [beside])
    if options.prior is not None:
        N = whole.regression.normal.information
        p, covariance, prior_share = options.prior.completed(robot, N, p, covariance)
    estimate = estimate_of(
        robot, "joint" if imported else "improved", fits, condition, (*unusable, *useless),
        solver.n_measurements, whole.effect, p, covariance, fit.degrees_of_freedom[:n],
    )  # fmt: skip
    return replace(
        estimate,
        residual=solver.residual,
        local=_believed(robot, found, p, estimate.local),
        drive_train=drive_train,
        load_friction=solver.load_friction,
        prior_share=prior_share,
        joint=None if imported else found,
        edges=drive_train.edges(robot),
        friction_law=campaign_friction(
            robot, p, (axes for _, axes in solver.stacked), history(robot, raw)
        ),
    ), fit


def _believed(
    robot: Robot, found: Joint, p: Array, local: Sequence[LocalValue]
) -> tuple[LocalValue, ...]:
    """Return values of step 1 after subtraction of effects found by the improved method."""
    prepared = {m.id: (m, s) for m, s in found.prepared if shows_element(m)}
    values = []
    for each in local:
        m, s = prepared[each.id]
        common = found.solver.solution[place(robot, m.index)[found.solver.n_base :]]
        seen = believed_fit(robot, m, s, p, common).evaluate(p)
        update = {"believed": seen.value, "believed_error": seen.standard_error}
        values.append(each.model_copy(update=update))
    for _, s in found.prepared:
        s.drop_rows()
    return tuple(values)


def doubt(
    robot: Robot, raw: Prepared, drive_train: DriveTrain, solver: SimultaneousFit
) -> tuple[Array, Array]:
    """Return correction and covariance of the base parameters from drive trains and encoders.

    Returns
    -------
    change : ndarray, shape (n_base,)
        Change of the base parameters by the correction for encoder quantisation.
    covariance : ndarray, shape (n_base, n_base)
    """
    change, of_steps = solver.steps()
    of_gears = covariance_of_gears(robot, raw, drive_train, solver.solve())
    return change, of_steps + of_gears + drive_train.covariance


def covariance_of_gears(robot: Robot, raw: Prepared, drive_train: DriveTrain, p: Array) -> Array:
    """Return the covariance of the base parameters from errors of gear compliances."""
    effects = [np.zeros(len(p))]
    for axis in np.flatnonzero(drive_train.soft):
        c = np.where(drive_train.soft, drive_train.compliance, 0.0)
        c[axis] += drive_train.compliance_error[axis]
        other = [(m, drive_train.applied(robot, s, c)) for m, s in raw]
        effects.append(SimultaneousFit(robot, other).solve() - p)
    return np.transpose(effects) @ effects


def estimate_of(
    robot: Robot,
    method: str,
    fits: Sequence[LocalFit],
    condition: dict[str, float],
    left_out: tuple[LeftOut, ...],
    n_measurements: int,
    effect: Array,
    p: Array,
    covariance: Array,
    degrees: Array,
) -> Estimate:
    """Assemble an estimate."""
    local = tuple(each.evaluate(p) for each in fits)
    residual = np.full(robot.n_joints, np.nan)
    for axis in range(robot.n_joints):
        # of the local models of inertia and coupling
        squares = [each.residual**2 for each in local if each.axis == axis and each.symbol == "M"]
        if squares:
            residual[axis] = np.sqrt(np.mean(squares))
    return Estimate(
        robot=robot,
        method=method,
        values=p,
        scatter_covariance=covariance,
        drive_covariance=covariance_of_drives(robot, effect),
        degrees_of_freedom=degrees,
        effect=effect,
        residual=residual,
        condition=condition,
        local=local,
        left_out=left_out,
        n_measurements=n_measurements,
        friction_law=FrictionLaw.absent(robot.n_joints),
    )


def prepare(recorded: Recorded) -> tuple[list[tuple[ParameterMotion, Signals]], list[LeftOut]]:
    """Return the signals of usable measurements, and the rejected measurements."""
    found, left_out = [], []
    for measurement, recording in recorded:
        if not shows_parameters(measurement):
            continue
        if isinstance(measurement, FreeMotion) and measurement.unknown_gains:
            axes = ", ".join(map(str, measurement.unknown_gains))
            raise NotIdentifiable(
                f"{measurement.id}: the gain of axis {axes} is unknown; only methods for free "
                f"motions find gains: use --method '{DEFAULT}', or state the gain in the map"
            )
        try:
            found.append((measurement, signals(recording)))
        except NotEnoughData as error:
            left_out.append(LeftOut(measurement.id, str(error)))
    return found, left_out


def fill_reached_limits(robot: Robot, prepared: Prepared) -> Robot:
    """Return the robot with unknown limits replaced by the values reached in measurements.

    Samples are selected by shares of the limits, and an import may lack limits.
    """
    if robot.limits_known or not prepared:
        return robot
    reached = {
        "velocity_limit": [np.abs(s.smoothed(s.qd)).max(axis=0) for _, s in prepared],
        "acceleration_limit": [np.abs(s.smoothed(s.qdd)).max(axis=0) for _, s in prepared],
        "torque_limit": [np.abs(s.smoothed(s.tau)).max(axis=0) for _, s in prepared],
    }
    least = np.finfo(float).tiny
    return robot.fill_limits(
        {key: np.maximum(np.max(each, axis=0), least) for key, each in reached.items()}
    )


def prepared_for(
    robot: Robot, found: Estimate, recorded: Recorded
) -> list[tuple[ParameterMotion, Signals]]:
    """Return the signals of an estimate's measurements with compensated drive trains."""
    unused = {left.id for left in found.left_out}
    own = [each for each in prepare(recorded)[0] if each[0].id not in unused]
    if found.drive_train is None:
        return own
    return [(m, found.drive_train.applied(robot, s)) for m, s in own]


def local_fits(robot: Robot, prepared: Prepared) -> tuple[list[LocalFit], list[LeftOut]]:
    """Evaluate step 1 for the measurements, and list the rejected ones."""
    found, left_out = [], []
    for measurement, s in prepared:
        if not shows_element(measurement):
            continue
        try:
            found.append(local_fit(robot, measurement, s))
        except NotEnoughData as error:
            left_out.append(LeftOut(measurement.id, str(error)))
    return found, left_out
