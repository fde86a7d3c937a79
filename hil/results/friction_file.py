"""Friction of a run: evaluated from its folder, and `friction.yaml` to hold what was found.

The file says for every axis which model is recommended, all models with their errors and the
outcome of the symmetry test, so that later steps (compensation beforehand, a gate before a
campaign) need no recordings. It can be written again at any time.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml

from drivers.yaml_file import FileError, FileModel, load_yaml
from hil.estimation.friction import symmetry
from hil.estimation.friction.choice import choose
from hil.estimation.friction.drift import Level, drift
from hil.estimation.friction.history import history
from hil.estimation.friction.models import KINDS, UNIT, FrictionModel, Kind
from hil.estimation.friction.points import GravityModel, points
from hil.measuring.atomic_file import write_file
from hil.measuring.run_folder import RunFolder
from hil.measuring.run_journal import now
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import Friction
from hil.results.model_file import load_model, recorded

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from hil.estimation.friction.choice import AxisFriction
    from hil.estimation.friction.drift import Drift
    from hil.estimation.friction.history import History
    from hil.estimation.friction.points import FrictionPoint
    from hil.estimation.friction.symmetry import Symmetry
    from hil.estimation.local_fits import LocalValue
    from hil.model.robot import Robot

NAME = "friction.yaml"


class ModelRecord(FileModel):
    """One friction model: parameters in SI, errors as root mean squares [N m]."""

    kind: Kind
    a: tuple[float, ...]
    standard_error: tuple[float | None, ...]
    units: tuple[str, ...]
    error: float
    held_out_error: float
    unidentifiable: tuple[str, ...]


class SymmetryRecord(FileModel):
    """Outcome of the symmetry test; see `hil.estimation.friction.symmetry`."""

    measurements: int
    asymmetry: float
    standard_error: float
    p_zero: float
    p_bound: float
    bound: float
    passed: bool


class AxisRecord(FileModel):
    """Friction of one axis; `axis` counts from 1."""

    axis: int
    chosen: Kind | None
    models: tuple[ModelRecord, ...]
    symmetry: SymmetryRecord | None


class FrictionFile(FileModel):
    """Content of `friction.yaml`."""

    format: Literal[1] = 1
    robot: str
    robot_digest: str
    plan_digest: str
    measured: str
    gravity: str
    written: str
    version: str
    left_out: tuple[str, ...]
    axes: tuple[AxisRecord, ...]

    def model(self, axis: int) -> FrictionModel | None:
        """Recommended model of an axis (index from 0), to be evaluated; None where there is none.

        Its standard errors and words are in `axes`.
        """
        for record in (r for r in self.axes if r.axis == axis + 1 and r.chosen):
            chosen = next(m for m in record.models if m.kind == record.chosen)
            error = np.array([np.nan if e is None else e for e in chosen.standard_error])
            a = np.array(chosen.a)
            return FrictionModel(chosen.kind, a, error, chosen.error**2, chosen.unidentifiable)
        return None


@dataclass(frozen=True, slots=True, eq=False)
class FrictionResult:
    """Everything that a run says about friction.

    Attributes
    ----------
    robot : Robot
    planned : dict
        Friction measurements by id.
    points : tuple of FrictionPoint
        In the order of the plan.
    axes : tuple of AxisFriction
        Axes with enough speeds for models.
    symmetry : tuple of Symmetry
        Axes whose gravity torque is known.
    drifts : tuple of Drift
        Axes with enough levels over time.
    history : History
    left_out : tuple of str
    gravity : str
        How gravity was compensated.
    """

    robot: Robot
    planned: dict[str, Friction]
    points: tuple[FrictionPoint, ...]
    axes: tuple[AxisFriction, ...]
    symmetry: tuple[Symmetry, ...]
    drifts: tuple[Drift, ...]
    history: History
    left_out: tuple[str, ...]
    gravity: str

    def of_axis(self, axis: int) -> list[FrictionPoint]:
        """Points of one axis (index from 0)."""
        return [point for point in self.points if point.axis == axis]


def evaluate(
    folder: RunFolder, model_folder: Path | None = None, bound: float = symmetry.BOUND
) -> FrictionResult:
    """Evaluate the friction measurements of a run.

    Parameters
    ----------
    folder : RunFolder
    model_folder : path, optional
        Folder of an identified run whose model compensates gravity; without it half-differences of
        both directions do.
    bound : float
        Asymmetry that is let pass, as share of the friction level.

    Raises
    ------
    FileError
        No friction measurements, a damaged recording, or a model of another robot.
    """
    robot = folder.robot
    everything = list(recorded(folder))
    chosen = [(m, r) for m, r in everything if isinstance(m, Friction)]
    if not chosen:
        raise FileError(
            f"{folder.path}: holds no friction measurements; plan some with: hil friction plan"
            f" {robot.name} -o friction.yaml"
        )
    found, left_out = points(robot, chosen, _gravity_model(robot, model_folder))
    axes = sorted({point.axis for point in found})
    own = {axis: [point for point in found if point.axis == axis] for axis in axes}
    fits = [choose(axis, own[axis], float(robot.velocity_limit[axis])) for axis in axes]
    past = history(robot, everything)
    drifts = [drift(axis, _levels(robot, own[axis]), past) for axis in axes]
    return FrictionResult(
        robot=robot,
        planned={m.id: m for m, _ in chosen},
        points=tuple(found),
        axes=tuple(fit for fit in fits if fit),
        symmetry=tuple(symmetry.of_points(found, bound)),
        drifts=tuple(each for each in drifts if each),
        history=past,
        left_out=tuple(left_out),
        gravity=f"model of {model_folder}" if model_folder else "half-differences",
    )


def fit(
    run_folder: Path | str, model_folder: Path | None = None, bound: float = symmetry.BOUND
) -> FrictionResult:
    """Evaluate a run's friction and write `friction.yaml` into its folder; see `evaluate`."""
    folder = RunFolder.open(run_folder)
    result = evaluate(folder, model_folder, bound)
    text = yaml.safe_dump(
        _content(folder, result).model_dump(mode="json"), sort_keys=False, width=200
    )
    write_file(folder.path / NAME, text.encode())
    return result


def load_friction(run_folder: Path | str) -> FrictionFile:
    """Read what was found about friction in a run.

    Raises
    ------
    FileError
        Nothing was evaluated yet, or the file was damaged.
    """
    path = RunFolder.open(run_folder).path / NAME
    if not path.exists():
        raise FileError(f"{path}: not there yet; make it with: hil friction fit {run_folder}")
    return load_yaml(path, FrictionFile)


def refuse_asymmetric(run_folder: Path | str, robot: Robot) -> list[str]:
    """Gate before a campaign: refuse a robot whose friction was found to be asymmetric.

    Returns
    -------
    list of str
        Axes that the test could not judge, one sentence.

    Raises
    ------
    FileError
        An axis failed, the run is of another robot, or nothing was tested.
    """
    found = load_friction(run_folder)
    source = f"{run_folder}/{NAME}"
    if found.robot_digest != robot.digest:
        raise FileError(f"{source}: is about {found.robot}, not about this {robot.name}")
    tested = {record.axis: record.symmetry for record in found.axes if record.symmetry}
    failed = [(axis, test) for axis, test in tested.items() if not test.passed]
    if failed:
        told = ", ".join(
            f"axis {axis}: {100 * test.asymmetry:+.1f} % (p = {test.p_bound:.1g})"
            for axis, test in failed
        )
        raise FileError(
            f"{source}: friction differs by direction by more than {100 * failed[0][1].bound:g} %:"
            f" {told}; look for a current sensor's offset or a worn gear, or go on without the gate"
        )
    if not tested:
        raise FileError(
            f"{source}: symmetry of no axis was tested; give hil friction fit an identified model"
            " with --model"
        )
    untested = [str(k) for k in range(1, robot.n_joints + 1) if k not in tested]
    return [f"symmetry of axis {', '.join(untested)} was not tested"] if untested else []


def campaign_drifts(robot: Robot, local: Iterable[LocalValue], past: History) -> tuple[Drift, ...]:
    """Time constants from the friction that step 1 finds by the way."""
    values = [value for value in local if value.friction > 0]
    drifts = [
        drift(axis, [Level(v.time, v.friction, v.kind) for v in values if v.axis == axis], past)
        for axis in range(robot.n_joints)
    ]
    return tuple(each for each in drifts if each)


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
    model = load_model(model_folder)
    names = tuple(parameter.name for parameter in model.parameters)
    if names != base_parameters(robot).names:
        raise FileError(
            f"{model_folder}: its model is about {model.provenance.robot}, whose parameters are not"
            f" those of {robot.name}; give a run of this robot"
        )
    return GravityModel(model.p, np.array(model.covariance))


def _content(folder: RunFolder, result: FrictionResult) -> FrictionFile:
    sessions = folder.journal.sessions
    return FrictionFile(
        robot=folder.robot.name,
        robot_digest=folder.robot.digest,
        plan_digest=folder.plan.digest,
        measured=sessions[-1].started if sessions else "",
        gravity=result.gravity,
        written=now(),
        version=version("canopen-robot-identification"),
        left_out=result.left_out,
        axes=tuple(_axis(axis, result) for axis in sorted({p.axis for p in result.points})),
    )


def _axis(axis: int, result: FrictionResult) -> AxisRecord:
    found = next((fit for fit in result.axes if fit.axis == axis), None)
    test = next((test for test in result.symmetry if test.axis == axis), None)
    models = () if found is None else tuple(
        ModelRecord(
            kind=kind,
            a=tuple(model.a.tolist()),
            standard_error=tuple(None if np.isnan(e) else float(e) for e in model.standard_error),
            units=UNIT[kind],
            error=float(np.sqrt(model.mean_square)),
            held_out_error=float(np.sqrt(found.held_out[kind])),
            unidentifiable=model.unidentifiable,
        )
        for kind in KINDS
        if (model := found.models.get(kind))
    )  # fmt: skip
    return AxisRecord(
        axis=axis + 1,
        chosen=found.chosen if found else None,
        models=models,
        symmetry=_symmetry(test) if test else None,
    )


def _symmetry(test: Symmetry) -> SymmetryRecord:
    return SymmetryRecord(
        measurements=test.n,
        asymmetry=test.asymmetry,
        standard_error=test.standard_error,
        p_zero=test.p_zero,
        p_bound=test.p_bound,
        bound=test.bound,
        passed=test.passed,
    )
