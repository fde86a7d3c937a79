"""Guarded workspace: permitted joint ranges, forbidden boxes, and clearance of an arm from them.

A workspace belongs to a robot's place of installation, so it is a file of its own. It may narrow
joint ranges, and it lists boxes that no link may enter: table, fence, controller cabinet, operator.
A plan contains its workspace, which is checked again wherever the plan is used.

Boxes are in the robot's base frame, in which the robot file gives gravity, with edges parallel to
its axes. A rotated obstacle takes several boxes.

Clearance between a moving arm and boxes is checked for links as capsules, over continuous sweeps. A
sweep is a set of configurations: all angles of a stroke, all instants of a travel. It is cut into
cells. A cell spans a small box of joint angles; the arm is placed at the middle of the cell's
parameters, a configuration of the sweep. Within the cell no point of a link moves farther than the
sum of the joints' half-ranges times their reach (`hil.model.capsules`). So a cell is clear for
certain if the distance between a link's segment and a box exceeds radius, margin and that bound;
otherwise it is halved. Cells of size `RESOLUTION` not proven clear count as hits: an accepted sweep
is safe, a rejected one may miss the box by a centimetre. Cells that cannot exceed the deepest hit
so far are skipped; if only the answer matters (`are_clear`), so are all further cells of a sweep
with a hit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple, Protocol

import numpy as np
from pydantic import Field, field_validator, model_validator

from checked_files.yaml_file import FileModel
from hil.model.capsules import capsules, segments
from hil.model.robot_file import Point

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Self

    from hil.arrays import Array, Indices, Mask
    from hil.model.robot import Robot


class Box(FileModel):
    """Box closed to the links, from corner `low` to corner `high` [m].

    Attributes
    ----------
    ignore_links : tuple of int
        Links (from 1) not checked against the box, such as a column fixed to the floor.
    """

    name: Annotated[str, Field(min_length=1)]
    low: Point
    high: Point
    ignore_links: tuple[Annotated[int, Field(ge=1)], ...] = ()

    @model_validator(mode="after")
    def _check_order(self) -> Self:
        for axis, low, high in zip("xyz", self.low, self.high, strict=True):
            if not low < high:
                raise ValueError(f"low {axis} = {low:g} m must be below high {axis} = {high:g} m")
        return self


class Workspace(FileModel):
    """Joint ranges and forbidden boxes at a robot's place of installation.

    Attributes
    ----------
    margin : float
        Minimum distance of every link from every box [m]; 5 cm by default.
    ranges : dict
        Joint (from 1) to its lower and upper end [rad or m], within the robot's own range.
    """

    margin: Annotated[float, Field(ge=0, le=1)] = 0.05
    ranges: dict[int, tuple[float, float]] = Field(default_factory=dict)
    boxes: tuple[Box, ...] = ()

    @field_validator("ranges")
    @classmethod
    def _check_ranges(cls, value: dict[int, tuple[float, float]]) -> dict[int, tuple[float, float]]:
        for joint, (low, high) in value.items():
            if not low < high:
                raise ValueError(f"joint {joint}: {low:g} must be below {high:g}; exchange them")
        return value

    @field_validator("boxes")
    @classmethod
    def _names_differ(cls, value: tuple[Box, ...]) -> tuple[Box, ...]:
        names = [box.name for box in value]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"{name} is stated twice; give each box a name of its own")
        return value


def narrow_ranges(robot: Robot, workspace: Workspace | None) -> Robot:
    """Return `robot` with the workspace's joint ranges, for checks only: the digest differs."""
    if workspace is None or not workspace.ranges:
        return robot
    ranges = workspace.ranges.items()
    return robot.replace_joints({k - 1: {"q_min": low, "q_max": high} for k, (low, high) in ranges})


RESOLUTION = 0.01
"""Largest motion of a link within a cell that is not halved further [m]."""

_CHUNK = 4096
"""Number of cells processed at once, which bounds the memory."""


class Sweep(Protocol):
    """Sets of configurations, identified by the number of an owner.

    Attributes
    ----------
    low, high : array (n_owners, n_parameters)
        Ranges of the parameters of each set.
    slack : float
        Uncertainty of a parameter.
    """

    low: Array
    high: Array
    slack: float

    def configurations(self, owner: Indices, parameters: Array) -> Array:
        """Return configurations (n, n_joints); each joint is monotonic in one parameter."""


class Hit(NamedTuple):
    """Deepest intrusion of a sweep.

    Attributes
    ----------
    link, box : int
        Indices from 0.
    depth : float
        Largest depth of the capsule with margin in the box [m].
    q : array (n_joints,)
        Configuration of the intrusion [rad or m].
    """

    link: int
    box: int
    depth: float
    q: Array


def are_clear(robot: Robot, workspace: Workspace, sweep: Sweep) -> Mask:
    """Return True for every owner of `sweep` clear of the boxes, shape (n_owners,)."""
    clear = np.ones(len(sweep.low), dtype=bool)
    clear[list(find_hits(robot, workspace, sweep, deepest=False))] = False
    return clear


def find_hits(
    robot: Robot, workspace: Workspace, sweep: Sweep, *, deepest: bool = True
) -> dict[int, Hit]:
    """Find an intrusion for every owner of `sweep` in a box: the deepest, or any."""
    found: dict[int, Hit] = {}
    if not workspace.boxes or not len(sweep.low):
        return found
    best = np.zeros(len(sweep.low))
    cells = [(np.arange(len(sweep.low)), sweep.low, sweep.high)]
    while cells:
        owner, low, high = cells.pop()
        if len(owner) > _CHUNK:
            cells += [(owner[s], low[s], high[s]) for s in (slice(_CHUNK), slice(_CHUNK, None))]
            continue
        middle = sweep.configurations(owner, (low + high) / 2)
        half = _farthest(
            middle, sweep.configurations(owner, low), sweep.configurations(owner, high)
        )
        slack = (
            sweep.configurations(owner, low - sweep.slack),
            sweep.configurations(owner, high + sweep.slack),
        )
        reach = capsules(robot).reach
        bound = _farthest(middle, *slack) @ reach.T
        small = (half @ reach.T).max(axis=1) < RESOLUTION
        depth = intrusions(robot, workspace, middle)
        sure = depth + np.where(small[:, None], bound, 0.0)[..., None]
        flat = sure.reshape(len(owner), -1)
        largest = flat.argmax(axis=1)
        for cell in np.flatnonzero(flat.max(axis=1) > best[owner]).tolist():
            value = float(flat[cell, largest[cell]])
            if value > best[owner[cell]]:
                link, box = divmod(int(largest[cell]), len(workspace.boxes))
                best[owner[cell]] = value
                found[int(owner[cell])] = Hit(link, box, value, middle[cell])
        possible = (depth + bound[..., None]).reshape(len(owner), -1).max(axis=1)
        undecided = (possible > best[owner]) & ~small
        if not deepest:
            undecided &= best[owner] == 0.0
        if not undecided.any():
            continue
        # halve the cells across the parameter with the largest effect on the arm
        owner, low, high = owner[undecided], low[undecided], high[undecided]
        span = high - low
        if low.shape[1] == robot.n_joints:
            span = span * reach.max(axis=0)
        widest, rows = span.argmax(axis=1), np.arange(len(owner))
        lower, upper = high.copy(), low.copy()
        lower[rows, widest] = upper[rows, widest] = (low + high)[rows, widest] / 2
        halves = np.concatenate([low, upper]), np.concatenate([lower, high])
        cells.append((np.concatenate([owner, owner]), *halves))
    return found


def box_distance(first: Array, last: Array, low: Sequence[float], high: Sequence[float]) -> Array:
    """Compute the distance of segments from a box, 0 where they enter the box [m].

    Along a segment the squared distance is convex and quadratic between the faces' planes, with a
    linear slope: the least distance is at the sign change of the slope.

    Parameters
    ----------
    first, last : array (..., 3)
        Ends of the segments.
    low, high : sequence (3,)
        Corners of the box.
    """
    way = last - first
    safe = np.where(way == 0.0, 1.0, way)
    planes = np.concatenate([(low - first) / safe, (high - first) / safe], axis=-1)
    ends = np.broadcast_to([0.0, 1.0], (*planes.shape[:-1], 2))
    s = np.sort(np.concatenate([np.clip(planes, 0.0, 1.0), ends], axis=-1), axis=-1)
    points = first[..., None, :] + s[..., None] * way[..., None, :]
    slope = ((points - np.clip(points, low, high)) * way[..., None, :]).sum(axis=-1)
    rising = slope >= 0.0
    after = np.where(rising.any(axis=-1), rising.argmax(axis=-1), s.shape[-1] - 1)[..., None]
    before = np.maximum(after - 1, 0)
    (s0, s1), (f0, f1) = (
        [np.take_along_axis(values, index, axis=-1) for index in (before, after)]
        for values in (s, slope)
    )
    share = np.clip(-f0 / np.where(f1 > f0, f1 - f0, 1.0), 0.0, 1.0)
    nearest = first + np.where(f1 > f0, s0 + share * (s1 - s0), s1) * way
    return np.asarray(np.linalg.norm(nearest - np.clip(nearest, low, high), axis=-1))


def _farthest(middle: Array, first: Array, last: Array) -> Array:
    return np.maximum(np.abs(first - middle), np.abs(last - middle))


def intrusions(robot: Robot, workspace: Workspace, q: Array) -> Array:
    """Compute the depth of links, with margin, in boxes, shape (n, n_links, n_boxes) [m].

    The depth is negative for a clear link, and minus infinity for a link ignored by the box.

    Parameters
    ----------
    q : array (n, n_joints)
        Configurations [rad or m].
    """
    placed = segments(robot, q)
    keep = capsules(robot).radii + workspace.margin
    depths = np.empty((len(q), robot.n_joints, len(workspace.boxes)))
    for number, box in enumerate(workspace.boxes):
        away = box_distance(placed[:, :, 0], placed[:, :, 1], box.low, box.high)
        depths[:, :, number] = keep - away
        depths[:, [link - 1 for link in box.ignore_links], number] = -np.inf
    return depths
