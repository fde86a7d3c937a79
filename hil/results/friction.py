"""Everything that a run says about friction, evaluated from its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch, NotEnoughData
from hil.estimation.friction import symmetry
from hil.estimation.friction.history import history
from hil.estimation.friction.points import GravityModel, points
from hil.friction.curves import choose
from hil.friction.drift import Level, drift
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import Friction, recorded_as
from hil.results.friction_file import FrictionResult
from hil.results.model import Model
from hil.runs.pooling import recorded
from hil.runs.run import opened

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.local_values import LocalValue
    from hil.friction.curves import AxisCurves
    from hil.friction.drift import Drift
    from hil.friction.warmth import History
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording
    from hil.runs.run import Run


def fit_friction(
    run: Run | Path | str,
    model: Path | str | None = None,
    asymmetry: float = symmetry.BOUND,
    recordings: Sequence[tuple[RecordedMotion, Recording]] | None = None,
) -> FrictionResult:
    """Fit laws of friction to a run and test their symmetry; nothing is written.

    Parameters
    ----------
    run : Run or path
        With measurements of friction.
    model : path, optional
        Identified run whose model compensates gravity; without it half-differences of both
        directions do.
    asymmetry : float
        Greatest asymmetry that is accepted, as a share of the friction level.
    recordings : sequence of (RecordedMotion, Recording), optional
        All of the run, where they were read already (`hil.runs.pooling.recorded`).

    Raises
    ------
    NotEnoughData
        No friction measurements.
    FileError
        No model, or a damaged one.
    Mismatch
        A model of another robot.
    """
    run = opened(run)
    robot, model_folder = run.robot, None if model is None else Path(model)
    recordings = list(recorded(run)) if recordings is None else recordings
    chosen = recorded_as(Friction, recordings)
    if not chosen:
        raise NotEnoughData(
            f"{run.path}: holds no friction measurements; plan some with: hil plan --kind friction"
            f" {robot.name} -o friction.yaml"
        )
    found, left_out = points(robot, chosen, _gravity_model(robot, model_folder))
    axes = sorted({point.axis for point in found})
    own = {axis: [point for point in found if point.axis == axis] for axis in axes}
    fits = [_curves(robot, axis, own[axis]) for axis in axes]
    past = history(robot, recordings)
    drifts = [drift(axis, _levels(robot, own[axis]), past) for axis in axes]
    return FrictionResult(
        robot=robot,
        planned={m.id: m for m, _ in chosen},
        points=tuple(found),
        axes=tuple(fit for fit in fits if fit),
        symmetry=symmetry.of_points(found, asymmetry),
        drifts=tuple(each for each in drifts if each),
        left_out=tuple(left_out),
        model_folder=str(model_folder) if model_folder else None,
    )


def campaign_drifts(robot: Robot, local: Iterable[LocalValue], past: History) -> tuple[Drift, ...]:
    """Time constants from the friction that step 1 finds by the way."""
    values = [value for value in local if value.friction > 0]
    drifts = [
        drift(axis, [Level(v.time, v.friction, v.kind) for v in values if v.axis == axis], past)
        for axis in range(robot.n_joints)
    ]
    return tuple(each for each in drifts if each)


def _curves(robot: Robot, axis: int, own: Sequence[FrictionPoint]) -> AxisCurves | None:
    velocity, friction = np.array([(point.velocity, point.friction) for point in own]).T
    limit, turns = float(robot.velocity_limit[axis]), bool(robot.revolute[axis])
    return choose(axis, velocity, friction, limit, turns=turns)


def _levels(robot: Robot, own: Sequence[FrictionPoint]) -> list[Level]:
    """Levels of one axis, those of one speed together."""
    return [
        Level(p.time, p.friction, f"{100 * p.velocity / robot.velocity_limit[p.axis]:.0f} %")
        for p in own
        if p.friction > 0
    ]


def _gravity_model(robot: Robot, model_folder: Path | None) -> GravityModel | None:
    if model_folder is None:
        return None
    model = Model.load(model_folder)
    if model.names != base_parameters(robot).names:
        raise Mismatch(
            f"{model_folder}: its model is about {model.robot.name}, whose parameters are not"
            f" those of {robot.name}; give a run of this robot"
        )
    return GravityModel(model.values, model.covariance)
