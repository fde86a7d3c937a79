"""`model.yaml`: content of the file of a model.

The file contains everything for using and judging the model: the robot, parameters with expression,
unit and uncertainty, their covariance, and their origin. Files of earlier versions lack the robot,
the degrees of freedom and the drives' part of the covariance. The robot is then that of the run
folder that contains the file, and the degrees of freedom are derived from the stated intervals.
"""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache
from math import isclose
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AliasChoices, BeforeValidator, Field, model_validator

from checked_files.yaml_file import FileError, FileModel, line_of, parse_yaml, read_text
from checked_files.yaml_lines import write_lines
from hil.estimation.back_and_forth.result import BackAndForthFit
from hil.estimation.consistent.result import ConsistentRobot
from hil.estimation.estimate import NO_DETAILS
from hil.estimation.excluded.result import ErrorTerm, Excluded
from hil.estimation.free_motion.result import FreeMotionFit
from hil.estimation.intervals import MANY, Edge, degrees_behind
from hil.estimation.local_fits import LocalValue
from hil.estimation.prior import FromPrior
from hil.friction.law import FrictionLaw
from hil.model.base_parameters import base_parameters
from hil.model.robot import Robot, parse_robot
from hil.results.identified_robot import IdentifiedRobot
from hil.results.judgement import Judgement, KeptJudgement
from hil.results.provenance import Provenance
from hil.results.refinement import Refinement
from hil.results.residual import BandResidual

if TYPE_CHECKING:
    from pathlib import Path


NAME = "model.yaml"


def _listed(value: Any) -> Any:
    """Return an array as nested lists, with None in place of NaN."""
    if not isinstance(value, np.ndarray):
        return value
    found = value.astype(object)
    found[np.isnan(value)] = None
    return found.tolist()


Vector = Annotated[tuple[float, ...], BeforeValidator(_listed)]
Matrix = Annotated[tuple[tuple[float, ...], ...], BeforeValidator(_listed)]


class Parameter(FileModel):
    """Base parameter; an unidentified parameter is zero, without standard error and interval."""

    name: str
    expression: str
    group: str
    unit: str
    value: float
    standard_error: float | None
    interval_95: tuple[float, float] | None

    @property
    def degrees_of_freedom(self) -> float:
        """Degrees of freedom, derived from the interval and the standard error."""
        if self.interval_95 is None:
            return MANY
        half = (self.interval_95[1] - self.interval_95[0]) / 2
        return degrees_behind(half / self.standard_error if self.standard_error else 0.0)


class ModelFile(FileModel):
    """Content of `model.yaml`; keys not listed here are fields of `IdentifiedRobot`.

    Attributes
    ----------
    covariance : tuple of tuple of float
        Covariance of the values, statistical and by the drives together, in the parameters' order
        and units.
    drive_covariance : tuple of tuple of float, optional
        Part of the covariance due to the drives.
    degrees_of_freedom : tuple of float, optional
        Effective degrees of freedom of the statistical part.
    friction_law : FrictionLaw, optional
        Friction over the campaign, by methods for strokes and trajectories; for free motions see
        `friction`.
    robot_file : str, optional
        The robot file, verbatim.
    local : tuple of LocalValue
        Single measurements with their friction over time, axes from 1; empty for imports and in
        files of earlier versions.
    """

    format: Literal[1] = 1
    provenance: Provenance
    parameters: tuple[Parameter, ...]
    covariance: Matrix
    drive_covariance: Matrix | None = None
    degrees_of_freedom: Vector | None = None
    residual: Annotated[tuple[float | None, ...], BeforeValidator(_listed)]
    condition: dict[str, float]
    error_budget: tuple[ErrorTerm, ...] = ()
    friction: FreeMotionFit | None = None
    back_and_forth: BackAndForthFit | None = None
    verdict: Annotated[
        Judgement | None, Field(validation_alias=AliasChoices("verdict", "outcome"))
    ] = None
    friction_law: FrictionLaw | None = None
    validations: tuple[KeptJudgement, ...] = ()
    consistent: ConsistentRobot | None = None
    verbatim: ClassVar[frozenset[str]] = frozenset({"robot_file"})
    robot_file: str | None = None
    local: tuple[LocalValue, ...] = ()
    torque_effect: Matrix | None = None
    excluded: Excluded | None = None
    prior: FromPrior | None = None
    edges: tuple[Edge, ...] = ()
    band_residual: BandResidual | None = None
    refinement: Refinement | None = None
    combination: Matrix | None = None

    @model_validator(mode="after")
    def _check_sizes(self) -> ModelFile:
        n, degrees = len(self.parameters), self.degrees_of_freedom
        for name, rows in (
            ("covariance", self.covariance),
            ("drive_covariance", self.drive_covariance),
            ("combination", self.combination),
        ):
            if rows is not None and [len(row) for row in rows] != [n] * n:
                raise ValueError(f"{name} must have {n} rows of {n} values, as many as parameters")
            if rows is not None and min((row[k] for k, row in enumerate(rows)), default=0.0) < 0:
                raise ValueError(f"{name} has a negative variance; identify the run anew")
        if degrees is not None and (len(degrees) != n or not min(degrees, default=1.0) > 0):
            raise ValueError(f"degrees_of_freedom must be {n} positive values, one per parameter")
        return self

    @classmethod
    def create(cls, model: IdentifiedRobot) -> ModelFile:
        """Create the file content of a model."""
        base = base_parameters(model.robot)
        group_of = {index: group for group, members in base.groups.items() for index in members}
        errors, intervals = model.standard_errors.tolist(), model.interval().tolist()
        parameters = tuple(
            Parameter(
                name=base.names[k],
                expression=base.expressions[k],
                group=group_of[k],
                unit=base.units[k],
                value=value,
                standard_error=errors[k] if identified else None,
                interval_95=tuple(intervals[k]) if identified else None,
            )
            for k, (value, identified) in enumerate(
                zip(model.values.tolist(), model.identified.tolist(), strict=True)
            )
        )
        details = model.details
        own: dict[str, Any] = {
            "parameters": parameters,
            "covariance": model.covariance,
            "torque_effect": model.torque_effect,
            "friction_law": None if details.with_law else model.friction_law,
            "robot_file": model.robot.text,
            "local": _counted(model.local, 1),
        }
        if details.file_key:
            own[details.file_key] = details
        return cls(**_common(model) | own)

    def identified(self, path: Path) -> dict[str, Any]:
        """Return the fields of `IdentifiedRobot` by name, for the model in the file at `path`.

        Raises
        ------
        FileError
            The robot is neither in the file nor in its folder, or is not the identified one.
        """
        total = np.array(self.covariance)
        stated, degrees = self.drive_covariance, self.degrees_of_freedom
        drives = np.zeros_like(total) if stated is None else np.array(stated)
        robot = self._robot(path)
        law = self.friction.law if self.friction else self.friction_law
        return _common(self) | {
            "robot": robot,
            "values": np.array([parameter.value for parameter in self.parameters]),
            "scatter_covariance": total - drives,
            "drive_covariance": drives,
            "degrees_of_freedom": np.array(
                [each.degrees_of_freedom for each in self.parameters]
                if degrees is None
                else degrees
            ),
            "residual": np.array(self.residual, dtype=float),
            "local": _counted(self.local, -1),
            "friction_law": law or FrictionLaw.absent(robot.n_joints),
            "details": self.friction or self.back_and_forth or NO_DETAILS,
            "effect": np.array(self.torque_effect or ((),)),
            "combination": None if self.combination is None else np.array(self.combination),
            "method": self.provenance.method,
            "n_measurements": self.provenance.measurements,
        }

    def _robot(self, path: Path) -> Robot:
        beside = path.parent / "robot.yaml"
        kept = self.robot_file
        robot = Robot.load(beside) if kept is None else parse_robot(kept, f"{path}: robot_file")
        names = tuple(parameter.name for parameter in self.parameters)
        if robot.digest != self.provenance.robot_digest or names != base_parameters(robot).names:
            place = f"in {beside}" if kept is None else "that it holds"
            raise FileError(
                f"{path}: its parameters are not those of the robot {place}; identify the run anew"
            )
        return robot

    def text(self) -> str:
        """Return the content as YAML, with the robot file as a separate block."""
        absent = {name for name, value in self if value is None}
        absent |= {name for name in ("validations", "local") if not getattr(self, name)}
        left_out: Any = dict.fromkeys(absent, True)
        believed = {"believed", "believed_error"}
        return write_lines(
            self.model_dump(mode="json", exclude={"local": {"__all__": believed}} | left_out)
        )


@lru_cache(maxsize=1)
def _parsed(text: str, path: str) -> ModelFile:
    """Parse a model's file, with a cache, since a command may need the file several times."""
    return parse_yaml(text, ModelFile, path)


def read_model_file(path: Path, same: float = 1e-6) -> ModelFile:
    """Read a model's file; refuse an incomplete or edited file by its first problem.

    Redundant values in the file must agree within the share `same`.

    Raises
    ------
    FileError
        One line, with the remedy.
    """
    remedy = f"write the file anew with: hil identify {path.parent}"
    text = read_text(path)
    try:
        kept = _parsed(text, str(path))
    except FileError as error:
        first, *_ = str(error).splitlines()
        raise FileError(f"{first}, or {remedy}") from error
    for number, each in enumerate(kept.parameters):
        variance = kept.covariance[number][number]
        if each.interval_95 is None or each.standard_error is None:
            continue
        low, high = each.interval_95
        if not (
            isclose((low + high) / 2, each.value, rel_tol=same, abs_tol=same * (high - low))
            and isclose(variance, each.standard_error**2, rel_tol=same)
        ):
            line = line_of(text, ("parameters", number, "value"))
            raise FileError(
                f"{path}:{line}: {each.name}: value, standard error and interval are "
                f"inconsistent (edited file?); {remedy}"
            )
    return kept


def file_of(path: Path) -> Path:
    """Return the path of a model's file, given the file or its folder."""
    return path if path.suffix and not path.is_dir() else path / NAME


def _common(of: IdentifiedRobot | ModelFile) -> dict[str, Any]:
    """Return the fields that a model and its file have in common, by name."""
    names = {each.name for each in fields(IdentifiedRobot)} & ModelFile.model_fields.keys()
    return {name: getattr(of, name) for name in names}


def _counted(local: tuple[LocalValue, ...], from_: int) -> tuple[LocalValue, ...]:
    """Return values with axes that count from 1 more, or less, than before."""
    return tuple(
        each.model_copy(update={"axis": each.axis + from_, "partner": each.partner + from_})
        for each in local
    )
