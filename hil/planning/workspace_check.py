"""Validation of a workspace against a robot: joints, units, boxes within reach.

A box in millimetres would be far beyond the arm and guard nothing. No point of a link is farther
from the base frame's origin than the lengths of the chain in between, so the arm bounds the
plausible coordinates: one beyond `FARTHEST` times the reach is refused as a wrong unit, and so is a
box smaller than a screw. A box nearer, yet beyond the reach of all links, is accepted with a remark
(`remarks`). A box that contains a link at every configuration is refused with a specific remedy,
instead of errors in every measurement of a plan.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import parse_yaml, read_text, refuse
from hil.model.capsules import capsules, link_reaches
from hil.planning.clearance import intrusions
from hil.planning.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hil.model.robot import Robot
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
    """Yield key and reason of every value in the workspace unsuitable for `robot`.

    Parameters
    ----------
    workspace : Workspace
    robot : Robot
    """
    for joint, (low, high) in workspace.ranges.items():
        if not 1 <= joint <= robot.n_joints:
            yield ("ranges", joint), f"{robot.name} has joints 1 to {robot.n_joints}"
        else:
            yield from _range(joint, low, high, robot)
    sound = True
    for number, box in enumerate(workspace.boxes):
        for place, reason in _check_box(box, robot):
            sound = False
            yield ("boxes", number, *place), reason
    if sound and workspace.boxes:
        yield from _always_inside(workspace, robot)


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


def _range(joint: int, low: float, high: float, robot: Robot) -> Iterator[tuple[Place, str]]:
    least, most = float(robot.q_min[joint - 1]), float(robot.q_max[joint - 1])
    if low >= least and high <= most:
        return
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


def _always_inside(workspace: Workspace, robot: Robot) -> Iterator[tuple[Place, str]]:
    """Yield boxes that contain a link at every sampled configuration."""
    # 256 configurations over the joint ranges; a link must be clear of a box in at least one
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
