"""A robot as a page draws it: frames by constant poses, capsules, limits, and which way is up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.capsules import capsules, reaches
from hil.model.link_poses import zero_pose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace
    from hil.view.visuals import Visual

    Array = NDArray[np.float64]


def robot_data(robot: Robot, visuals: Sequence[Visual] = ()) -> dict[str, object]:
    """As a page has it; `visuals` are shown in place of the capsules.

    Two capsules of a swept volume are 0.7 of the smallest radius apart.
    """
    shapes = capsules(robot)
    ways = np.maximum(shapes.reach.max(axis=0), shapes.radii.min())
    return {
        "name": robot.name,
        "up": _up(robot.gravity),
        "reach": float(reaches(robot).max()),
        "joints": [
            _joint(robot, j) | {"step": float(0.7 * shapes.radii.min() / ways[j])}
            for j in range(robot.n_joints)
        ],
        "meshes": [visual.data() for visual in visuals],
    }


def workspace_data(workspace: Workspace | None) -> dict[str, object] | None:
    """Boxes and margin as a page has them."""
    if workspace is None:
        return None
    boxes = [{"name": b.name, "low": b.low, "high": b.high} for b in workspace.boxes]
    return {"margin": workspace.margin, "boxes": boxes}


def _joint(robot: Robot, joint: int) -> dict[str, object]:
    shapes = capsules(robot)
    return {
        "revolute": bool(robot.revolute[joint]),
        "before": (zero_pose(robot, joint).ravel() + 0.0).tolist(),  # no -0.0
        "lower": float(robot.q_min[joint]),
        "upper": float(robot.q_max[joint]),
        "velocity": _known(robot.velocity_limit[joint]),
        "torque": _known(robot.torque_limit[joint]),
        "unit": robot.position_unit(joint),
        "torque_unit": robot.torque_unit(joint),
        "capsule": {
            "ends": shapes.ends[joint].tolist(),
            "radius": float(shapes.radii[joint]),
        },
    }


def _known(limit: float) -> float | None:
    return float(limit) if np.isfinite(limit) else None


def _up(gravity: Array) -> list[float]:
    """Against gravity; along z where there is none."""
    strength = float(np.linalg.norm(gravity))
    return [0.0, 0.0, 1.0] if strength == 0.0 else (-gravity / strength).tolist()
