"""`hil friction`: friction models and symmetry tests of a run, written to `friction.yaml`.

The file states for every axis the recommended model, all models with errors, and the result of the
symmetry test. Feed-forward and the gate before a campaign need no recordings.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from checked_files.yaml_file import FileError, FileModel
from hil.errors import AsymmetricFriction, Mismatch, NotEnoughData
from hil.estimation.friction.points import (
    BOUND,
    GravityModel,
    Symmetry,
    history,
    judge_points,
    points,
)
from hil.friction.curves import FrictionModel, Law, choose
from hil.friction.drift import Level, drift
from hil.model.base_parameters import base_parameters
from hil.planning.measurement import Friction, select_kind
from hil.results.model import Model
from hil.results.provenance import KeptResult
from hil.results.tables import friction as tables
from hil.runs.journal import now
from hil.runs.pooling import recorded
from hil.runs.run import opened
from hil.show.outcome import Outcome
from hil.show.rounding import significant, uncertain
from hil.show.table import Column, Part, Table, figures, table
from hil.version import __version__

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.estimation.friction.points import FrictionPoint
    from hil.friction.curves import AxisCurves
    from hil.friction.drift import Drift
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording
    from hil.runs.run import Run
    from hil.show.table import Row

NAME = "friction.yaml"


@dataclass(frozen=True, slots=True, eq=False)
class FrictionResult:
    """Friction results of a run.

    Attributes
    ----------
    planned : dict
        Friction measurements by id.
    points : tuple of FrictionPoint
        Friction points in the order of the plan.
    axes : tuple of AxisCurves
        Axes with enough speeds for models.
    symmetry : dict of int to Symmetry
        Symmetry by axis, from 0, for axes of known gravity torque.
    drifts : tuple of Drift
        Axes with enough levels over time.
    model_folder : str, optional
        Run of the model that compensated gravity.
    """

    robot: Robot
    planned: dict[str, Friction]
    points: tuple[FrictionPoint, ...]
    axes: tuple[AxisCurves, ...]
    symmetry: dict[int, Symmetry]
    drifts: tuple[Drift, ...]
    left_out: tuple[str, ...]
    model_folder: str | None

    @property
    def gravity(self) -> str:
        """Compensation of gravity, in words."""
        return f"model of {self.model_folder}" if self.model_folder else "half-differences"

    def axis_points(self, axis: int) -> list[FrictionPoint]:
        """Return the points of an axis (from 0)."""
        return [point for point in self.points if point.axis == axis]


class AxisRecord(FileModel):
    """Friction of one axis; `axis` counts from 1."""

    axis: int
    chosen: Law | None
    models: tuple[FrictionModel, ...]
    symmetry: Symmetry | None


class FrictionFile(KeptResult):
    """Content of `friction.yaml`."""

    names = (NAME,)
    format: Literal[1] = 1
    robot: str
    robot_digest: str
    plan_digest: str
    measured: str
    gravity: str
    model_folder: str | None
    written: str
    version: str
    left_out: tuple[str, ...]
    axes: tuple[AxisRecord, ...]

    @property
    def bound(self) -> float | None:
        """Largest accepted asymmetry; None without a test."""
        return next((axis.symmetry.bound for axis in self.axes if axis.symmetry), None)

    def model(self, axis: int) -> FrictionModel | None:
        """Return the recommended model of an axis (from 0), or None."""
        every = ((r, m) for r in self.axes for m in r.models if r.axis == axis + 1)
        return next((m for r, m in every if m.kind == r.chosen), None)


def fit_friction(
    run: Run | Path | str,
    model: Path | str | None = None,
    asymmetry: float = BOUND,
    recordings: Sequence[tuple[RecordedMotion, Recording]] | None = None,
) -> FrictionResult:
    """Fit laws of friction to a run and test their symmetry; nothing is written.

    Parameters
    ----------
    run : Run or path
        Run with friction measurements.
    model : path, optional
        Identified run of a model that compensates gravity. Without a model, half of the difference
        of both directions is free of gravity.
    asymmetry : float
        Largest accepted asymmetry, as a share of the friction level.
    recordings : sequence of (RecordedMotion, Recording), optional
        All recordings of the run, if already read (`hil.runs.pooling.recorded`).

    Raises
    ------
    NotEnoughData
        No friction measurements.
    FileError
        No model, or a damaged one.
    Mismatch
        A model of another robot.

    Examples
    --------
    >>> fitted = hil.fit_friction("runs/friction")
    >>> [curves.axis for curves in fitted.axes], len(fitted.points)  # axes from 0
    ([5], 16)
    """
    run = opened(run)
    robot, model_folder = run.robot, None if model is None else Path(model)
    recordings = list(recorded(run)) if recordings is None else recordings
    chosen = select_kind(Friction, recordings)
    if not chosen:
        raise NotEnoughData(
            f"{run.path}: holds no friction measurements; plan some with: hil plan --kind friction"
            f" {robot.name} -o friction.yaml"
        )
    gravity = None
    if model_folder is not None:
        of = Model.load(model_folder)
        if of.names != base_parameters(robot).names:
            raise Mismatch(
                f"{model_folder}: is a model of {of.robot.name}, with other parameters than "
                f"{robot.name}; give a run of {robot.name}"
            )
        gravity = GravityModel(of.values, of.covariance)
    found, left_out = points(robot, chosen, gravity)
    past, fits, drifts = history(robot, recordings), [], []
    for axis in sorted({point.axis for point in found}):
        own = [point for point in found if point.axis == axis]
        velocity, friction = np.array([(point.velocity, point.friction) for point in own]).T
        limit = float(robot.velocity_limit[axis])
        fits.append(choose(axis, velocity, friction, limit, turns=bool(robot.revolute[axis])))
        # only levels at equal speed are compared
        levels = [
            Level(point.time, point.friction, f"{100 * point.velocity / limit:.0f} %")
            for point in own
            if point.friction > 0
        ]
        drifts.append(drift(axis, levels, past))
    return FrictionResult(
        robot=robot,
        planned={m.id: m for m, _ in chosen},
        points=tuple(found),
        axes=tuple(fit for fit in fits if fit),
        symmetry=judge_points(found, asymmetry),
        drifts=tuple(each for each in drifts if each),
        left_out=tuple(left_out),
        model_folder=str(model_folder) if model_folder else None,
    )


def write_friction(run: Run, result: FrictionResult) -> Path:
    """Write `friction.yaml` into the folder of the run, atomically."""
    sessions, curves = run.journal.sessions, {fit.axis: fit for fit in result.axes}
    content = FrictionFile(
        robot=run.robot.name,
        robot_digest=run.robot.digest,
        plan_digest=run.plan.digest,
        measured=sessions[-1].started if sessions else "",
        gravity=result.gravity,
        model_folder=result.model_folder,
        written=now(),
        version=__version__,
        left_out=result.left_out,
        axes=tuple(
            AxisRecord(
                axis=axis + 1,
                chosen=curves[axis].chosen if axis in curves else None,
                models=tuple(curves[axis].models.values()) if axis in curves else (),
                symmetry=result.symmetry.get(axis),
            )
            for axis in sorted({point.axis for point in result.points})
        ),
    )
    return content.write(run.path)


def load_friction(run: Run) -> FrictionFile:
    """Read the friction results of a run.

    Raises
    ------
    FileError
        Friction was not evaluated, or a damaged file.
    """
    found = FrictionFile.read(run.path)
    if found is None:
        raise FileError(
            f"{run.path / NAME}: does not exist yet; make it with: hil friction {run.path}"
        )
    return found


def refuse_asymmetric(run: Run, robot: Robot) -> list[str]:
    """Refuse a robot with asymmetric friction before a campaign.

    Returns
    -------
    list of str
        A sentence that names axes without a test result; empty without such axes.

    Raises
    ------
    AsymmetricFriction
        An axis failed, or no axis was tested.
    Mismatch
        Run of another robot.
    FileError
        Friction of the run was not evaluated.
    """
    found = load_friction(run)
    source = f"{run.path}/{NAME}"
    if found.robot_digest != robot.digest:
        raise Mismatch(
            f"{source}: belongs to another robot file ({found.robot}) than that of {robot.name}; "
            "name a run of this robot"
        )
    tested = {record.axis: record.symmetry for record in found.axes if record.symmetry}
    failed = [(axis, test) for axis, test in tested.items() if not test.passed]
    if failed:
        asymmetries = ", ".join(
            f"axis {axis}: {100 * test.asymmetry:+.1f} % (p = {test.p_bound:.1g})"
            for axis, test in failed
        )
        raise AsymmetricFriction(
            f"{source}: friction differs by direction by more than {100 * failed[0][1].bound:g} "
            f"%: {asymmetries}; look for a current sensor's offset or a worn gear, or continue "
            "without this check"
        )
    if not tested:
        raise AsymmetricFriction(
            f"{source}: symmetry of no axis was tested; give hil friction an identified model"
            " with --model"
        )
    untested = [str(k) for k in range(1, robot.n_joints + 1) if k not in tested]
    return [f"symmetry of axis {', '.join(untested)} was not tested"] if untested else []


def outcome(run: Run, found: FrictionResult) -> Outcome:
    """Return the outcome: friction models, symmetry and drift of a run."""
    return Outcome(
        (models(found), tables.symmetry(found.symmetry), tables.drift(found.drifts)),
        tuple(f"left out: {left}" for left in found.left_out),
        simulated=run.journal.simulated,
    )


def models(result: FrictionResult) -> Table:
    """Return the table of models and errors, with notes on unidentifiable parameters."""
    return table(
        f"{result.robot.name}: {len(result.points)} friction measurements, gravity by"
        f" {result.gravity}",
        (
            "axis",
            "model",
            *figures(*(f"{head}, {result.robot.torque_units}" for head in ("rms", "held out"))),
            "chosen",
            Column("parameters with std. errors", folds=True),
        ),
        (Part(tuple(_models(fit))) for fit in result.axes),
        "Linear: eq. (1); cube-root: eq. (2); arctan: eq. (3). Root mean square errors of the "
        "fit and at held-out speeds. The simplest model is chosen unless another is "
        "significantly better at held-out speeds.",
        tuple(
            f"axis {fit.axis + 1}, {kind}: {word}"
            for fit in result.axes
            for kind, model in fit.models.items()
            for word in model.unidentifiable
        ),
    )


def _models(fit: AxisCurves) -> Iterator[Row]:
    for number, (kind, model) in enumerate(fit.models.items()):
        errors = (significant(each, 3) for each in (model.error, model.held_out_error or 0.0))
        chosen = "yes" if kind == fit.chosen else ""
        yield "" if number else str(fit.axis + 1), kind, *errors, chosen, _parameters(model)


def _parameters(model: FrictionModel) -> str:
    each = zip(model.a, model.standard_error, model.units, strict=True)
    written = ((*uncertain(a, np.nan if e is None else e), unit) for a, e, unit in each)
    return ", ".join(
        f"a{k} {value} ± {error} {unit}" for k, (value, error, unit) in enumerate(written, start=1)
    )
