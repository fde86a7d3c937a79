"""Step 2: from measurements to base parameters, with their uncertainty.

printed
    Section 6.1 as it stands (`two_step`): weighted least squares for p_g, then for p_Md with
    p_g compensated, then for p_Mod.
improved
    The condensed measurements of all kinds are added up and solved for all groups at once
    (`hil.estimation.simultaneous`).
    Before, the torque of each axis is shifted by its lag behind the positions, as the measurements
    themselves show it (`hil.estimation.torque_lag`); what that leaves uncertain is added.

Standard errors come from leaving out one measurement at a time (the jackknife of
`hil.regression.uncertainty`): they hold whatever differs from one measurement to the next, noise,
drift or a misfit of the friction terms, and assume nothing about any of them. If few measurements
carry a parameter its standard error is itself uncertain; it has fewer degrees of freedom.

Two errors cannot show in the data, however long one measures: those of the torque constants and of
the rotor inertias. Where the robot file states their uncertainty it is carried to the parameters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from hil.errors import NotEnoughData, NotIdentifiable, UnknownName
from hil.estimation.conventional.variants import VARIANTS, fit_trajectories, trajectories
from hil.estimation.estimate import Estimate, LeftOut
from hil.estimation.local_fits import ELSEWHERE, local_fit
from hil.estimation.signals import signals
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.torque_lag import find_lags
from hil.estimation.two_step import TwoStep
from hil.model.base_parameters import base_parameters
from hil.model.dependencies import GROUPS
from hil.planning.measurement import ELEMENT_KINDS, shows_element
from hil.regression.least_squares import undetermined
from hil.regression.uncertainty import effective_degrees, jackknife

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.local_values import LocalFit, LocalValue
    from hil.estimation.signals import Signals
    from hil.estimation.torque_lag import Lags
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement, Measurement
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]
    Prepared = Sequence[tuple[ElementMeasurement, Signals]]
    Recorded = Iterable[tuple[Measurement, Recording]]
    Identify = Callable[[Robot, Recorded], Estimate]

TwoStepMethod = Literal["improved", "printed"]
TWO_STEP_METHODS: tuple[TwoStepMethod, ...] = ("improved", "printed")
_FEWEST_DEGREES = 2.0
"""Of freedom: of Student's t with fewer, intervals are too wide to be of use."""


class ParameterSolver(Protocol):
    """Solves for the base parameters, with all measurements or without one of them."""

    @property
    def n_measurements(self) -> int:
        """How many measurements there are to leave out."""

    def solve(self, without: int | None = None) -> Array:
        """Base parameters, shape (n_base,)."""

    def sensitivity(self) -> Array:
        """Change of p per relative change of each axis's torque constant, then rotor inertia.

        Shape (n_base, 2 n_joints).
        """


def estimates(
    robot: Robot,
    recorded: Recorded,
    methods: Sequence[TwoStepMethod] = TWO_STEP_METHODS,
) -> dict[TwoStepMethod, Estimate]:
    """Identify by several two-step methods, which share the signals.

    Raises
    ------
    NotIdentifiable
        Base parameters that the measurements do not excite.
    """
    raw, unusable = prepare(recorded)
    found = {}
    for method in methods:
        lags = find_lags(robot, raw) if method == "improved" else None
        prepared = raw if lags is None else _advanced(raw, lags)
        fits, useless = _local_fits(robot, prepared)
        condition = _require_rank(robot, fits)
        left_out = (*unusable, *useless)
        found[method] = _estimate(robot, prepared, fits, condition, left_out, lags, method)
    return found


def _estimate(
    robot: Robot,
    prepared: Prepared,
    fits: Sequence[LocalFit],
    condition: dict[str, float],
    left_out: tuple[LeftOut, ...],
    lags: Lags | None,
    method: TwoStepMethod,
) -> Estimate:
    solver: ParameterSolver = (
        TwoStep(robot, fits) if method == "printed" else SimultaneousFit(robot, prepared)
    )
    p = solver.solve()
    changes = np.array([solver.solve(without) for without in range(solver.n_measurements)]) - p
    local = tuple(each.at(p) for each in fits)
    relative = np.concatenate([robot.torque_constant_uncertainty, robot.rotor_inertia_uncertainty])
    carried = solver.sensitivity() * relative
    return Estimate(
        method=method,
        p=p,
        covariance=jackknife(changes) + (0.0 if lags is None else lags.covariance),
        degrees_of_freedom=effective_degrees(changes**2, _FEWEST_DEGREES),
        drive_covariance=carried @ carried.T,
        drive_effect=carried,
        residual=_residual(robot, local),
        condition=condition,
        local=local,
        left_out=left_out,
        n_measurements=len(local),
        lags=lags,
    )


def prepare(
    recorded: Recorded,
) -> tuple[list[tuple[ElementMeasurement, Signals]], list[LeftOut]]:
    """Signals of all measurements that are of use here, and why others have none."""
    found, left_out = [], []
    for measurement, recording in recorded:
        if not shows_element(measurement):
            remark = ELSEWHERE[measurement.kind]
            left_out += [LeftOut(measurement.id, remark)] if remark else []
            continue
        try:
            found.append((measurement, signals(recording)))
        except NotEnoughData as error:
            left_out.append(LeftOut(measurement.id, str(error)))
    return found, left_out


def prepared_for(found: Estimate, recorded: Recorded) -> list[tuple[ElementMeasurement, Signals]]:
    """Signals of the measurements behind an estimate, their torques advanced by its lags."""
    used = {value.id for value in found.local}
    own = [each for each in prepare(recorded)[0] if each[0].id in used]
    return own if found.lags is None else _advanced(own, found.lags)


def _advanced(prepared: Prepared, lags: Lags) -> list[tuple[ElementMeasurement, Signals]]:
    return [(measurement, s.torque_advanced(lags.lag)) for measurement, s in prepared]


def _local_fits(robot: Robot, prepared: Prepared) -> tuple[list[LocalFit], list[LeftOut]]:
    """Step 1 for all measurements, and the reasons for those that are of no use."""
    found, left_out = [], []
    for measurement, s in prepared:
        try:
            found.append(local_fit(robot, measurement, s))
        except NotEnoughData as error:
            left_out.append(LeftOut(measurement.id, str(error)))
    return found, left_out


def _residual(robot: Robot, local: Sequence[LocalValue]) -> Array:
    """Root mean square of what the local models of inertia and coupling leave of each axis."""
    found = np.full(robot.n_joints, np.nan)
    for axis in range(robot.n_joints):
        squares = [f.residual**2 for f in local if f.axis == axis and f.symbol == "M"]
        if squares:
            found[axis] = np.sqrt(np.mean(squares))
    return found


def _require_rank(robot: Robot, fits: Sequence[LocalFit]) -> dict[str, float]:
    """Condition number of each group's observation matrix.

    Raises
    ------
    NotIdentifiable
        One that lacks rank.
    """
    base = base_parameters(robot)
    condition: dict[str, float] = {}
    for group in GROUPS:
        columns = list(base.groups[group])
        if not columns:
            continue
        kinds = [name for name, kind in ELEMENT_KINDS.items() if kind.group == group]
        rows = [f.row[columns] / robot.torque_limit[f.axis] for f in fits if f.kind in kinds]
        W = np.array(rows).reshape(len(rows), len(columns))
        if undetermined(W.T @ W).any():
            names = ", ".join(base.names[c] for c in columns)
            raise NotIdentifiable(
                f"{len(rows)} usable {' and '.join(kinds)} measurements do not identify {names};"
                " measure more configurations of that kind (see: hil dry-run), or finish the run"
                " with --resume"
            )
        condition[group] = float(np.linalg.cond(W))
    return condition


def _two_step(method: TwoStepMethod) -> Identify:
    return lambda robot, recorded: estimates(robot, recorded, (method,))[method]


def _conventional(name: str) -> Identify:
    def identify(robot: Robot, recorded: Recorded) -> Estimate:
        return fit_trajectories(robot, trajectories(recorded), VARIANTS[name], name=name)

    return identify


METHODS: dict[str, Identify] = {
    **{method: _two_step(method) for method in TWO_STEP_METHODS},
    **{name: _conventional(name) for name in VARIANTS},
}
"""All methods by name: the two-step ones, and the conventional ones from trajectories."""


def estimate(robot: Robot, recorded: Recorded, method: str = "improved") -> Estimate:
    """Identify the base parameters of `robot`.

    Parameters
    ----------
    robot : Robot
    recorded : iterable of (Measurement, Recording)
    method : str
        One of `METHODS`.

    Raises
    ------
    UnknownName
        There is no such method.
    NotIdentifiable
        Base parameters that the measurements do not excite.
    NotEnoughData
        A conventional method without trajectories.
    """
    if method not in METHODS:
        raise UnknownName(f"method {method!r} must be one of: {'; '.join(METHODS)}")
    return METHODS[method](robot, recorded)
