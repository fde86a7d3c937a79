"""`model.yaml`: an identified model as a file, and how a run folder gets one.

The file says all that is needed to use the model and to judge it: parameters with expression, unit
and uncertainty, the covariance, and where they come from. It can be written again at any time from
the run's recordings; nothing in it is an input to anything but reports.
"""

from __future__ import annotations

from importlib.metadata import version
from typing import TYPE_CHECKING, Literal

import numpy as np
import yaml

from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.estimation.identify import Method, NotIdentifiable, estimate
from hil.model.base_parameters import base_parameters
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.runs.pooling import open_runs, pooled, recorded
from hil.runs.run_folder import RunFolder

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate

__all__ = [
    "NAME",
    "ModelFile",
    "Parameter",
    "Provenance",
    "identify",
    "load_model",
    "recorded",
]

NAME = "model.yaml"


class Parameter(FileModel):
    """One base parameter."""

    name: str
    expression: str
    group: str
    unit: str
    value: float
    standard_error: float
    interval_95: tuple[float, float]


class Provenance(FileModel):
    """Where a model comes from; `together_with` names further runs that it was made from."""

    robot: str
    robot_digest: str
    plan_digest: str
    measured: str
    bus: str
    measurements: int
    missing: int = 0
    together_with: tuple[str, ...] = ()
    left_out: tuple[str, ...]
    identified: str
    method: str
    version: str


class ModelFile(FileModel):
    """Content of `model.yaml`.

    Attributes
    ----------
    covariance : tuple of tuple of float
        Of the values, statistical and of the drives together, in the parameters' order and units.
    residual : tuple of float or None
        Root mean square of what the local models leave of each axis's torque [N m].
    condition : dict
        Condition number of each group's observation matrix.
    """

    format: Literal[1] = 1
    provenance: Provenance
    parameters: tuple[Parameter, ...]
    covariance: tuple[tuple[float, ...], ...]
    residual: tuple[float | None, ...]
    condition: dict[str, float]

    @property
    def p(self) -> NDArray[np.float64]:
        """Base parameters, shape (n_base,)."""
        return np.array([parameter.value for parameter in self.parameters])


def identify(
    run_folder: Path | str, method: Method = "improved", others: Sequence[Path | str] = ()
) -> Estimate:
    """Estimate the base parameters from a run and write `model.yaml` into its folder.

    Parameters
    ----------
    run_folder : path
    method : {"improved", "printed"}
        See `hil.estimation.identify`.
    others : sequence of path
        Further runs of the same robot, identified together with the first.

    Raises
    ------
    FileError
        No run folder, a damaged recording, or measurements that do not suffice.
    """
    folder, *more = open_runs([run_folder, *others])
    try:
        result = estimate(folder.robot, pooled([folder, *more]), method)
    except NotIdentifiable as error:
        raise FileError(f"{folder.path}: {error}") from error
    content = _content(folder, result, more)
    text = yaml.safe_dump(content.model_dump(mode="json"), sort_keys=False, width=200)
    write_file(folder.path / NAME, text.encode())
    return result


def load_model(run_folder: Path | str) -> ModelFile:
    """Read the model of a run.

    Raises
    ------
    FileError
        The run has not been identified, or the file was damaged.
    """
    path = RunFolder.open(run_folder).path / NAME
    if not path.exists():
        raise FileError(f"{path}: not there yet; make it with: hil identify {run_folder}")
    return load_yaml(path, ModelFile)


def _content(folder: RunFolder, result: Estimate, more: Sequence[RunFolder]) -> ModelFile:
    base = base_parameters(folder.robot)
    group_of = {index: group for group, members in base.groups.items() for index in members}
    half = result.half_width()
    parameters = tuple(
        Parameter(
            name=base.names[k],
            expression=base.expressions[k],
            group=group_of[k],
            unit=base.units[k],
            value=float(result.p[k]),
            standard_error=float(result.standard_error[k]),
            interval_95=(float(result.p[k] - half[k]), float(result.p[k] + half[k])),
        )
        for k in range(len(base))
    )
    sessions = folder.journal.sessions
    provenance = Provenance(
        robot=folder.robot.name,
        robot_digest=folder.robot.digest,
        plan_digest=folder.plan.digest,
        measured=sessions[-1].started if sessions else "",
        bus=sessions[-1].bus if sessions else "",
        measurements=len(result.local),
        missing=sum(len(each.missing) for each in (folder, *more)),
        together_with=tuple(str(each.path) for each in more),
        left_out=result.left_out,
        identified=now(),
        method=result.method,
        version=version("canopen-robot-identification"),
    )
    covariance = result.covariance + result.drive_covariance
    return ModelFile(
        provenance=provenance,
        parameters=parameters,
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        residual=tuple(None if np.isnan(r) else float(r) for r in result.residual),
        condition=result.condition,
    )
