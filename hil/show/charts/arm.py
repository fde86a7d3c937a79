"""Picture of the arm: capsules in an oblique parallel projection from above.

The picture needs no scripts and can be printed; `hil.view` draws the same capsules in three
dimensions. Links are drawn from the farthest to the nearest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from hil.model.capsules import capsules, segments
from hil.show.charts.svg import number, text

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot

SEEN_FROM = (1.0, -1.1, 0.7)
"""Initial viewpoint of the page of `hil view`: forward, right, up."""
WIDTH, HEIGHT, MARGIN = 330.0, 270.0, 12.0


def arm(robot: Robot, q: Array) -> Markup:
    """Draw a robot at a configuration, shape (n_joints,) [rad or m], with axis numbers."""
    ends = segments(robot, q[np.newaxis])[0]
    radii = capsules(robot).radii
    view = _view(robot.gravity)
    seen = ends @ view.T
    low = (seen[..., :2] - radii[:, np.newaxis, np.newaxis]).min(axis=(0, 1))
    high = (seen[..., :2] + radii[:, np.newaxis, np.newaxis]).max(axis=(0, 1))
    room = np.array([WIDTH, HEIGHT]) - 2 * MARGIN
    scale = float((room / np.maximum(high - low, 1e-9)).min())
    at = MARGIN + (room - scale * (high - low)) / 2 + scale * (seen[..., :2] - low)
    at[..., 1] = HEIGHT - at[..., 1]
    farthest_first = np.argsort(seen[..., 2].mean(axis=1), kind="stable")
    drawn = "".join(_link(at[link], scale * radii[link]) for link in farthest_first)
    numbers = "".join(
        text(float(x), float(y), str(axis), "middle joint")
        for axis, (x, y) in enumerate(at[:, 0], start=1)
    )
    box = f"0 0 {number(WIDTH)} {number(HEIGHT)}"
    return Markup(f'<svg viewBox="{box}">{drawn}{numbers}</svg>')  # noqa: S704 - numbers alone


def _view(gravity: Array) -> Array:
    """Return unit vectors right, up and toward the viewer in the base frame, as rows (3, 3)."""
    strength = float(np.linalg.norm(gravity))
    up = -gravity / strength if strength else np.array([0.0, 0.0, 1.0])
    # smallest rotation from z to up
    first = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = first - up * (first @ up)
    frame = np.array([x / np.linalg.norm(x), np.cross(up, x / np.linalg.norm(x)), up])
    toward = np.array(SEEN_FROM) @ frame
    toward /= np.linalg.norm(toward)
    right = np.cross(up, toward)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(toward, right), toward])


def _link(ends: Array, radius: float) -> str:
    """Draw a capsule with rim and highlight."""
    path = "M{} {}L{} {}".format(*map(number, ends.ravel().tolist()))
    layers = (("rim", radius + 1.0), ("link", radius), ("lit", 0.55 * radius))
    return "".join(
        f'<path class="{kind}" stroke-width="{number(2 * width)}" d="{path}"/>'
        for kind, width in layers
    )
