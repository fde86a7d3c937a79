"""Plan of a campaign, as data.

A plan is a frozen, validated document that never touches hardware. A dry run checks it, the
sequencer carries it out, and `diff` compares two plans: a short block per measurement
(`measurement`), rounded numbers, and a plan read back equals the plan written. A plan contains the
digest of its robot file, so that it never moves another robot.

A workspace is checked against the robot: joints, units, boxes within reach. A box in millimetres
would be far beyond the arm and guard nothing. No point of a link is farther from the base frame's
origin than the lengths of the chain in between, so the arm bounds the plausible coordinates: one
beyond `FARTHEST` times the reach is refused as a wrong unit, and so is a box smaller than a screw.
A box nearer, yet beyond the reach of all links, is accepted with a remark (`remarks`). A box that
contains a link at every configuration is refused with a specific remedy, instead of errors in every
measurement of a plan.
"""

from __future__ import annotations

import hashlib
import math
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import AfterValidator, Field, field_validator, model_validator

from checked_files.yaml_events import Dumper
from checked_files.yaml_file import FileError, FileModel, load_yaml, parse_yaml, read_text, refuse
from hil.model.capsules import capsules, link_reaches
from hil.model.robot import Robot, refuse_unknown
from hil.planning import LONGEST
from hil.planning.free_motion import FreeMotion
from hil.planning.measurement import KEYS, Measurement
from hil.planning.plan_values import LONGEST_NAME, Fraction, round_to_millionths
from hil.planning.workspace import Workspace, intrusions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hil.planning.workspace import Box


FARTHEST = 20.0
"""Largest coordinate of a box, in multiples of the arm's reach."""
SMALLEST = 1 / 500
"""Smallest useful longest edge of a box, as share of the reach."""

Place = tuple[str | int, ...]


def load_workspace(path: Path | str, robot: Robot) -> Workspace:
    """Read a workspace file for `robot`.

    Raises
    ------
    FileError
        No workspace file, or one for another robot.
    """
    text = read_text(path)
    workspace = parse_yaml(text, Workspace, str(path))
    refuse_unfit(workspace, robot, str(path), text)
    return workspace


def refuse_unfit(
    workspace: Workspace,
    robot: Robot,
    source: str,
    text: str | None = None,
    within: tuple[str, ...] = (),
) -> None:
    """Refuse a workspace with joints, ranges or boxes unsuitable for `robot`.

    Parameters
    ----------
    source, text : str
        Name of the file, and its text for line numbers.
    within : tuple of str
        Keys of the workspace within the file.

    Raises
    ------
    FileError
        One line per problem.
    """
    wrong = (((*within, *at), reason) for at, reason in misfits(workspace, robot))
    refuse(source, text, wrong)


def misfits(workspace: Workspace, robot: Robot) -> Iterator[tuple[Place, str]]:
    """Yield key and reason of every value in the workspace unsuitable for `robot`."""
    for joint, (low, high) in workspace.ranges.items():
        if not 1 <= joint <= robot.n_joints:
            yield ("ranges", joint), f"{robot.name} has joints 1 to {robot.n_joints}"
        else:
            least, most = float(robot.q_min[joint - 1]), float(robot.q_max[joint - 1])
            if low >= least and high <= most:
                continue
            revolute = bool(robot.revolute[joint - 1])
            unit, other = ("rad", "degrees") if revolute else ("m", "millimetres")
            si = [math.radians(value) if revolute else value / 1000 for value in (low, high)]
            hint = ""
            if si[0] >= least and si[1] <= most:
                hint = f"; in {other}? then write [{si[0]:.5g}, {si[1]:.5g}]"
            yield (
                ("ranges", joint),
                f"{low:g} ... {high:g} must lie within the range of the robot file,"
                f" {least:g} ... {most:g} {unit}; a workspace narrows, it never widens{hint}",
            )
    sound = True
    for number, box in enumerate(workspace.boxes):
        for place, reason in _check_box(box, robot):
            sound = False
            yield ("boxes", number, *place), reason
    if not (sound and workspace.boxes):
        return
    # boxes that contain a link at each of 256 configurations over the joint ranges
    spread = np.random.default_rng(0).uniform(size=(256, robot.n_joints))
    q = robot.q_min + spread * (robot.q_max - robot.q_min)
    inside = np.all(intrusions(robot, workspace, q) > 0.0, axis=0)
    for number, box in enumerate(workspace.boxes):
        links = [k + 1 for k in np.flatnonzero(inside[:, number]).tolist()]
        if links:
            which = f"link {links[0]}" if len(links) == 1 else f"links {', '.join(map(str, links))}"
            assumed = not all(capsules(robot).stated[k - 1] for k in links)
            yield (
                ("boxes", number),
                f"{box.name} contains {which} of {robot.name} at every "
                f"configuration{' (with an assumed capsule)' if assumed else ''}, so nothing "
                "could be measured; correct its corners, or, if the arm is fixed to it, state "
                f"ignore_links: {[*box.ignore_links, *links]}",
            )


def remarks(workspace: Workspace | None, robot: Robot) -> list[str]:
    """Return a remark for every box beyond the reach of the links."""
    if workspace is None:
        return []
    reach = link_reaches(robot)
    lines = []
    for box in workspace.boxes:
        checked = [k for k in range(robot.n_joints) if k + 1 not in box.ignore_links]
        farthest = max((float(reach[k]) for k in checked), default=0.0)
        nearest = math.hypot(*np.clip(0.0, box.low, box.high))
        if nearest > farthest + workspace.margin:
            lines.append(
                f"box {box.name} has no effect: {nearest:.3g} m or more from the origin of the "
                f"base frame, reach of the checked links {farthest:.3g} m; check its place, unit "
                "(m) and ignore_links"
            )
    return lines


def _check_box(box: Box, robot: Robot) -> Iterator[tuple[Place, str]]:
    """Check a box for nonexistent links and for coordinates in another unit than metres."""
    if any(link > robot.n_joints for link in box.ignore_links):
        yield ("ignore_links",), f"{robot.name} has links 1 to {robot.n_joints}"
    reach = float(link_reaches(robot).max())
    far = FARTHEST * reach
    for key, corner in (("low", box.low), ("high", box.high)):
        worst = max(corner, key=abs)
        if abs(worst) > far:
            yield (
                (key,),
                f"{worst:g} m of {box.name} must be within +-{far:.3g} m, {FARTHEST:g} times the"
                f" reach of {robot.name}: it looks like millimetres; then write {worst / 1000:g}",
            )
    edge = max(high - low for low, high in zip(box.low, box.high, strict=True))
    if edge < SMALLEST * reach:
        yield (
            ("high",),
            f"{box.name} has a largest edge of {edge:.2g} m, must be at least "
            f"{SMALLEST * reach:.2g} m ({SMALLEST:g} of the reach of {robot.name}); lengths are "
            "in m",
        )


def opened_plan(
    plan: Plan | Path | str,
    robot: Robot | Path | str | None = None,
    workspace: Workspace | Path | str | None = None,
) -> tuple[Plan, Robot]:
    """Return a plan with the workspace, and the robot.

    Parameters
    ----------
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
        named: str | Path = the_plan.robot.name
        if the_plan.robot.file is not None:
            named = Path(source).parent / the_plan.robot.file
            if robot is None and not named.exists():
                raise FileError(
                    f"{source}: robot.file: {named} does not exist; name the robot file with "
                    "--robot"
                )
        robot = Robot.load(robot or named)
    refuse_unknown(robot)
    refuse_other_robot(the_plan, robot, source)
    if workspace is not None:
        if isinstance(workspace, (str, Path)):
            workspace = load_workspace(Path(workspace), robot)
        the_plan = the_plan.model_copy(update={"workspace": workspace})
    return the_plan, robot


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
