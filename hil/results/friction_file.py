"""`friction.yaml`: what was found about friction, as a file in the run's folder.

It says for every axis which model is recommended, all models with their errors and the
outcome of the symmetry test, so that later steps (compensation beforehand, a gate before a
campaign) need no recordings. It can be written again at any time.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml

from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.estimation.friction.models import LAWS, FrictionModel, Law, units
from hil.runs.atomic_file import write_file
from hil.runs.journal import now

if TYPE_CHECKING:
    from pathlib import Path

    from hil.estimation.friction.symmetry import Symmetry
    from hil.results.friction_result import FrictionResult
    from hil.runs.run import Run

NAME = "friction.yaml"


class ModelRecord(FileModel):
    """One friction model: parameters in SI, errors as root mean squares [N m]."""

    kind: Law
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
    chosen: Law | None
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
    model_folder: str | None
    written: str
    version: str
    left_out: tuple[str, ...]
    axes: tuple[AxisRecord, ...]

    @property
    def bound(self) -> float | None:
        """Greatest asymmetry that the tests accepted; None where no axis was tested."""
        return next((axis.symmetry.bound for axis in self.axes if axis.symmetry), None)

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


def write_friction(run: Run, result: FrictionResult) -> Path:
    """Write `friction.yaml` into the run's folder, whole or not at all."""
    path = run.path / NAME
    text = yaml.safe_dump(_content(run, result).model_dump(mode="json"), sort_keys=False, width=200)
    write_file(path, text.encode())
    return path


def load_friction(run: Run) -> FrictionFile:
    """Read what was found about friction in a run.

    Raises
    ------
    FileError
        Nothing was evaluated yet, or the file was damaged.
    """
    path = run.path / NAME
    if not path.exists():
        raise FileError(f"{path}: not there yet; make it with: hil friction fit {run.path}")
    return load_yaml(path, FrictionFile)


def _content(run: Run, result: FrictionResult) -> FrictionFile:
    sessions = run.journal.sessions
    return FrictionFile(
        robot=run.robot.name,
        robot_digest=run.robot.digest,
        plan_digest=run.plan.digest,
        measured=sessions[-1].started if sessions else "",
        gravity=result.gravity,
        model_folder=result.model_folder,
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
            units=units(kind, turns=bool(result.robot.revolute[axis])),
            error=float(np.sqrt(model.mean_square)),
            held_out_error=float(np.sqrt(found.held_out[kind])),
            unidentifiable=model.unidentifiable,
        )
        for kind in LAWS
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
