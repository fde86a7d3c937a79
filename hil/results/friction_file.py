"""What a run says about friction, and the file `friction.yaml` that keeps it in the run's folder.

The file says for every axis which model is recommended, all models with their errors and the
outcome of the symmetry test, so that later steps need no recordings: compensation beforehand, and a
gate before a campaign. It can be written again at any time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from checked_files.yaml_file import FileError, FileModel, load_yaml
from hil.errors import AsymmetricFriction, Mismatch
from hil.estimation.friction.symmetry import Symmetry
from hil.friction.curves import FrictionModel, Law
from hil.runs.atomic_file import write_file
from hil.runs.journal import now
from hil.version import __version__

if TYPE_CHECKING:
    from pathlib import Path

    from hil.estimation.friction.points import FrictionPoint
    from hil.friction.curves import AxisCurves
    from hil.friction.drift import Drift
    from hil.model.robot import Robot
    from hil.planning.measurement import Friction
    from hil.runs.run import Run

NAME = "friction.yaml"


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
    axes : tuple of AxisCurves
        Axes with enough speeds for models.
    symmetry : dict of int to Symmetry
        Axes, from 0, whose gravity torque is known.
    drifts : tuple of Drift
        Axes with enough levels over time.
    left_out : tuple of str
    model_folder : str, optional
        Run whose model compensated gravity.
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
        """How gravity was compensated."""
        return f"model of {self.model_folder}" if self.model_folder else "half-differences"

    def of_axis(self, axis: int) -> list[FrictionPoint]:
        """Points of one axis (index from 0)."""
        return [point for point in self.points if point.axis == axis]


class AxisRecord(FileModel):
    """Friction of one axis; `axis` counts from 1."""

    axis: int
    chosen: Law | None
    models: tuple[FrictionModel, ...]
    symmetry: Symmetry | None


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
        """Recommended model of an axis (index from 0); None where there is none."""
        every = ((r, m) for r in self.axes for m in r.models if r.axis == axis + 1)
        return next((m for r, m in every if m.kind == r.chosen), None)


def write_friction(run: Run, result: FrictionResult) -> Path:
    """Write `friction.yaml` into the run's folder, whole or not at all."""
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
    path = run.path / NAME
    write_file(path, content.as_yaml())
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
        raise FileError(f"{path}: not there yet; make it with: hil friction {run.path}")
    return load_yaml(path, FrictionFile)


def refuse_asymmetric(run: Run, robot: Robot) -> list[str]:
    """Gate before a campaign: refuse a robot whose friction was found to be asymmetric.

    Returns
    -------
    list of str
        Axes that the test could not judge, one sentence.

    Raises
    ------
    AsymmetricFriction
        An axis failed, or nothing was tested.
    Mismatch
        The run is of another robot.
    FileError
        Its friction was not evaluated yet.
    """
    found = load_friction(run)
    source = f"{run.path}/{NAME}"
    if found.robot_digest != robot.digest:
        raise Mismatch(f"{source}: is about {found.robot}, not about this {robot.name}")
    tested = {record.axis: record.symmetry for record in found.axes if record.symmetry}
    failed = [(axis, test) for axis, test in tested.items() if not test.passed]
    if failed:
        asymmetries = ", ".join(
            f"axis {axis}: {100 * test.asymmetry:+.1f} % (p = {test.p_bound:.1g})"
            for axis, test in failed
        )
        raise AsymmetricFriction(
            f"{source}: friction differs by direction by more than {100 * failed[0][1].bound:g} %:"
            f" {asymmetries}; look for a current sensor's offset or a worn gear, or go on without"
            " the gate"
        )
    if not tested:
        raise AsymmetricFriction(
            f"{source}: symmetry of no axis was tested; give hil friction an identified model"
            " with --model"
        )
    untested = [str(k) for k in range(1, robot.n_joints + 1) if k not in tested]
    return [f"symmetry of axis {', '.join(untested)} was not tested"] if untested else []
