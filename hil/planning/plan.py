"""Plan of a campaign, as data.

A plan is a frozen, validated document that never touches hardware. A dry run checks it, the
sequencer carries it out, and `diff` compares two plans: a short block per measurement
(`measurement`), rounded numbers, and a plan read back equals the plan written. A plan contains the
digest of its robot file, so that it never moves another robot.
"""

from __future__ import annotations

import hashlib
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import yaml
from pydantic import AfterValidator, Field, field_validator, model_validator

from checked_files.yaml_events import Dumper
from checked_files.yaml_file import FileError, FileModel, load_yaml, read_text, refuse
from hil.model.robot import Robot, refuse_unknown
from hil.planning import LONGEST
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import KEYS, Measurement
from hil.planning.plan_values import LONGEST_NAME, Fraction, round_to_millionths
from hil.planning.workspace import Workspace
from hil.planning.workspace_check import load_workspace, refuse_unfit

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


def opened_plan(
    plan: Plan | Path | str,
    robot: Robot | Path | str | None = None,
    workspace: Workspace | Path | str | None = None,
) -> tuple[Plan, Robot]:
    """Return a plan with the workspace, and the robot.

    Parameters
    ----------
    plan : Plan or path
    robot : Robot, path or str, optional
        Robot, by default the one named in the plan.
    workspace : Workspace or path, optional
        Workspace in place of the plan's own.

    Raises
    ------
    FileError
        One of the files cannot be used, or the plan is of another robot.
    """
    source = str(plan) if isinstance(plan, (str, Path)) else "plan"
    the_plan = plan if isinstance(plan, Plan) else load_plan(Path(plan))
    if not isinstance(robot, Robot):
        robot = Robot.load(robot or _robot_file(the_plan, Path(source)))
    refuse_unknown(robot)
    refuse_other_robot(the_plan, robot, source)
    if workspace is not None:
        if isinstance(workspace, (str, Path)):
            workspace = load_workspace(Path(workspace), robot)
        the_plan = the_plan.model_copy(update={"workspace": workspace})
    return the_plan, robot


def _robot_file(the_plan: Plan, source: Path) -> str | Path:
    """Return the name of the plan's robot, or the path of an existing robot file."""
    if the_plan.robot.file is None:
        return the_plan.robot.name
    path = source.parent / the_plan.robot.file
    if not path.exists():
        raise FileError(
            f"{source}: robot.file: {path} does not exist; name the robot file with --robot"
        )
    return path


class PlannedRobot(FileModel):
    """Reference to the robot that a plan was made for.

    Attributes
    ----------
    name, digest : str
        Name of the robot, and digest of the file's content.
    file : str, optional
        Path of the robot file, relative to the plan's folder; None for a built-in robot.
    """

    name: str
    digest: str
    file: str | None = None


class WarmUp(FileModel):
    """Motion before the first measurement: duration [s] and share of the limits."""

    duration: Annotated[float, Field(gt=0, le=LONGEST)]
    fraction: Fraction = 0.5


class Plan(FileModel):
    """Campaign: robot, travel settings and measurements in order.

    Attributes
    ----------
    sample_period : float
        Time between samples [s].
    travel : float
        Share of the velocity and acceleration limits used between configurations.
    attempts : int
        Maximum number of attempts; afterwards the best recording is kept with its findings.
    workspace : Workspace, optional
        Workspace to keep clear along every path.
    """

    format: Literal[1] = 1
    robot: PlannedRobot
    sample_period: Annotated[float, Field(ge=1e-4, le=0.1), AfterValidator(round_to_millionths)] = (
        0.004
    )
    travel: Fraction = 0.3
    attempts: int = Field(default=3, ge=1, le=20)
    warm_up: WarmUp | None = None
    workspace: Workspace | None = None
    measurements: tuple[Measurement, ...] = Field(min_length=1)

    @model_validator(mode="before")
    @classmethod
    def _is_a_plan(cls, given: object) -> object:
        if isinstance(given, dict) and "map_digest" in given:
            raise ValueError(
                "lists imported recordings, with nothing to measure; identify the run folder "
                "with hil identify, or make a plan with hil plan"
            )
        return given

    @field_validator("measurements")
    @classmethod
    def _ids_differ(cls, measurements: tuple[Measurement, ...]) -> tuple[Measurement, ...]:
        seen: dict[str, int] = {}
        for number, measurement in enumerate(measurements):
            first = seen.setdefault(measurement.id, number)
            if first != number:
                raise ValueError(
                    f"measurements {first} and {number} have the same id {measurement.id}; "
                    "give each its own"
                )
        return measurements

    @property
    def digest(self) -> str:
        """Fingerprint of the content, independent of comments and layout of the file."""
        return hashlib.sha256(dump_plan(self).encode()).hexdigest()


def make_plan(
    robot: Robot,
    measurements: Iterable[Measurement],
    warm_up: float = 0.0,
    workspace: Workspace | None = None,
) -> Plan:
    """Create a plan from `measurements` of a robot, after a warm-up of this duration [s]."""
    return Plan(
        robot=PlannedRobot(name=robot.name, digest=robot.digest),
        warm_up=WarmUp(duration=warm_up) if warm_up else None,
        workspace=workspace,
        measurements=tuple(measurements),
    )


def load_plan(path: Path | str, robot: Robot | None = None) -> Plan:
    """Read a plan; with `robot`, refuse a plan made for another robot.

    Raises
    ------
    FileError
        The file is not a plan, or the plan is for another robot.
    """
    plan = load_yaml(path, Plan)
    if robot is not None:
        refuse_other_robot(plan, robot, path)
    return plan


def refuse_other_robot(plan: Plan, robot: Robot, path: Path | str) -> None:
    """Refuse a plan made for another robot, or for an earlier version of the robot file.

    Parameters
    ----------
    path : path or str
        Path of the plan's file, named in messages with the line.

    Raises
    ------
    FileError
        Name, digest or number of joints differ.
    """
    if wrong := list(islice(_find_mismatches(plan, robot), 1)):
        refuse(str(path), read_text(path), wrong)
    if plan.workspace is not None:
        refuse_unfit(plan.workspace, robot, str(path), within=("workspace",))


def _find_mismatches(plan: Plan, robot: Robot) -> Iterator[tuple[tuple[str | int, ...], str]]:
    remedy = f"make a new plan with: hil plan {robot.name} -o plan.yaml"
    if plan.robot.name != robot.name:
        yield (
            ("robot", "name"),
            f"the plan is for {plan.robot.name}, not for {robot.name}; {remedy}",
        )
    if plan.robot.digest != robot.digest:
        yield (
            ("robot", "digest"),
            f"the robot file of {robot.name} was changed since the plan was made"
            f" ({plan.robot.digest[:12]} then, {robot.digest[:12]} now); {remedy}",
        )
    for number, measurement in enumerate(plan.measurements):
        if len(measurement.q) != robot.n_joints:
            yield (
                ("measurements", number, "q"),
                f"{len(measurement.q)} values must be {robot.n_joints}, one for each joint of"
                f" {robot.name}",
            )


def repeat_measurements(plan: Plan, rounds: int) -> Plan:
    """Repeat the measurements of a plan, with the round's number in the ids.

    Raises
    ------
    FileError
        An id is too long to append the round's number.
    """
    if rounds == 1:
        return plan
    measurements = [
        each.model_copy(update={"id": f"{each.id}-{number}"})
        for number in range(1, rounds + 1)
        for each in plan.measurements
    ]
    longest = max((each.id for each in measurements), key=len)
    if len(longest) > LONGEST_NAME:
        raise FileError(
            f"measurements: {longest} has {len(longest)} characters with its number, at most "
            f"{LONGEST_NAME} allowed; give it a shorter id"
        )
    return plan.model_copy(update={"measurements": tuple(measurements)})


def dump_plan(plan: Plan) -> str:
    """Format a plan as YAML: a short block per measurement, joints on a line."""
    data = plan.model_dump(mode="json", exclude_none=True)
    data["measurements"] = [
        {key: item[key] for key in sorted(item, key=KEYS.index)} for item in data["measurements"]
    ]
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=200)


class _Dumper(Dumper):
    """YAML dumper with lists of numbers on a line, everything else in blocks."""

    def represent_sequence(
        self, tag: str, sequence: Any, flow_style: bool | None = None
    ) -> yaml.SequenceNode:
        numbers = all(isinstance(item, float | int) for item in sequence)
        node: yaml.SequenceNode = super().represent_sequence(
            tag, sequence, flow_style=numbers or flow_style
        )
        return node


class RecordedMotions(FileModel):
    """Imported motions of a robot; no new measurement is possible.

    Attributes
    ----------
    map_digest : str
        SHA-256 of the map of the recordings.
    """

    format: Literal[1] = 1
    robot: PlannedRobot
    map_digest: str
    measurements: tuple[FreeMotion, ...] = Field(min_length=1)

    @property
    def digest(self) -> str:
        """Fingerprint of the content."""
        return hashlib.sha256(self.text().encode()).hexdigest()

    def text(self) -> str:
        """Format as YAML."""
        content = self.model_dump(mode="json", exclude_none=True)
        text: str = yaml.dump(content, Dumper=Dumper, sort_keys=False, width=200)
        return text
