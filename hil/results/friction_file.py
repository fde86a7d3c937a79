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
from hil.estimation.friction.models import LAWS, UNIT, FrictionModel, Law
from hil.estimation.friction.symmetry import BOUND
from hil.results.friction import FrictionResult, evaluate
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.runs.pooling import recorded
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from pathlib import Path

    from hil.estimation.friction.symmetry import Symmetry

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


def fit(
    run_folder: Path | str, model_folder: Path | None = None, bound: float = BOUND
) -> FrictionResult:
    """Evaluate a run's friction and write `friction.yaml` into its folder; see `evaluate`."""
    folder = RunFolder.open(run_folder)
    result = evaluate(folder, list(recorded(folder)), model_folder, bound)
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


def _content(folder: RunFolder, result: FrictionResult) -> FrictionFile:
    sessions = folder.journal.sessions
    return FrictionFile(
        robot=folder.robot.name,
        robot_digest=folder.robot.digest,
        plan_digest=folder.plan.digest,
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
            units=UNIT[kind],
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
