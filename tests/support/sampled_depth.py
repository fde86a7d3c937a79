"""Depth of an arm in forbidden boxes, from samples alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.model.capsules import capsules, segments
from hil.planning.workspace import box_distance

if TYPE_CHECKING:
    import numpy as np

    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace


def sampled_depth(robot: Robot, workspace: Workspace, q: np.ndarray) -> float:
    placed, keep = segments(robot, q), capsules(robot).radii + workspace.margin
    return max(
        float((keep - box_distance(placed[:, :, 0], placed[:, :, 1], box.low, box.high)).max())
        for box in workspace.boxes
    )
