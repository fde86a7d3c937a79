"""Clearance of a plan's paths from the forbidden boxes: measurements and travels.

The sweep of a measurement is the stroke of its axis; with a partner, the rectangle of both strokes.
A travel moves all axes at once, each with a trapezoid of its own duration; the axes may start up to
`SKEW` apart, since each drive begins when it has taken its set-point. The robot's configuration
before the first travel is only known at run time, so the sequencer checks every travel again before
commanding it (`refuse_travel`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.drive_bus import LimitExceeded
from hil.model.capsules import capsules
from hil.planning.clearance import find_hits
from hil.planning.timetable import travels

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.clearance import Hit
    from hil.planning.plan import Plan
    from hil.planning.workspace import Workspace


_IN_A_PLAN = (
    "plan again with --workspace, choose another configuration or order, or correct box or capsule"
)
_AT_THE_START = "correct box or capsule, or move the arm away with hil drives jog"


class JointBoxes:
    """Boxes in joint space, spanned by two configurations (n, n_joints) [rad or m]."""

    slack = 0.0

    def __init__(self, start: Array, end: Array) -> None:
        self.low = np.minimum(start, end)
        self.high = np.maximum(start, end)

    def configurations(self, owner: Indices, parameters: Array) -> Array:
        """Return the parameters, which are joint coordinates."""
        del owner
        return parameters


def obstacles(plan: Plan, robot: Robot) -> Iterator[tuple[int, str]]:
    """Yield the paths of `plan` too close to a box of the workspace.

    Yields
    ------
    tuple of int and str
        Number of the measurement in the plan, from 0; path, link, box, depth and remedy.
    """
    workspace, measurements = plan.workspace, plan.measurements
    if workspace is None:
        return
    start, end = (np.array([getattr(m, at) for m in measurements]) for at in ("start", "end"))
    hits = find_hits(robot, workspace, JointBoxes(start, end))
    for number, measurement in enumerate(measurements):
        if measurement.streamed:  # joints move straight between set-points
            path = measurement.once.path(plan.sample_period)
            on_path = find_hits(robot, workspace, JointBoxes(path[:-1], path[1:])).values()
            hits |= {number: max(on_path, key=lambda hit: hit.depth)} if on_path else {}
    for number, hit in sorted(hits.items()):
        yield number, f"{measurements[number].id}: {_describe(hit, robot, workspace)}"
    ways = [("travel to", 1, start[:-1], start[1:], plan.travel)]
    if plan.warm_up:
        fraction, following = plan.warm_up.fraction, np.roll(start, -1, 0)
        ways += [("warm-up at", 0, start, end, fraction)]
        ways += [("warm-up after", 0, end, following, fraction)]
    for what, first, begins, ends, fraction in ways:
        hits = find_hits(robot, workspace, travels(begins, ends, fraction, robot))
        for number, hit in sorted(hits.items()):
            place = f"{what} {measurements[number + first].id}"
            yield number + first, f"{place}: {_describe(hit, robot, workspace)}"


def refuse_travel(
    robot: Robot,
    workspace: Workspace | None,
    start: Sequence[float],
    end: Sequence[float],
    fraction: float,
) -> None:
    """Refuse a travel too close to a box.

    Raises
    ------
    LimitExceeded
        Message with link and box; nothing has moved.
    """
    if workspace is None:
        return
    here = np.array([start])
    for hit in find_hits(robot, workspace, JointBoxes(here, here)).values():
        raise LimitExceeded(
            f"the arm is inside {workspace.boxes[hit.box].name} or too near: "
            f"{_describe(hit, robot, workspace, _AT_THE_START)}"
        )
    sweep = travels(here, np.array([end]), fraction, robot)
    for hit in find_hits(robot, workspace, sweep).values():
        where = ", ".join(f"{q:.3g}" for q in start)
        raise LimitExceeded(
            f"travel from ({where}): {_describe(hit, robot, workspace)}; move the robot closer "
            "to the next configuration with hil drives jog"
        )


def _describe(hit: Hit, robot: Robot, workspace: Workspace, remedy: str = _IN_A_PLAN) -> str:
    shapes, box = capsules(robot), workspace.boxes[hit.box]
    into = hit.depth - workspace.margin
    if into >= shapes.radii[hit.link]:
        far = f"runs right into {box.name}"
    elif into > 0:
        far = f"reaches {into:.3f} m into {box.name}"
    else:
        far = f"comes within {-into:.3f} m of {box.name}, margin {workspace.margin:g} m,"
    assumed = "" if shapes.stated[hit.link] else " (its capsule is assumed, none is stated)"
    where = ", ".join(f"{q:.3g}" for q in hit.q)
    return f"link {hit.link + 1} {far} at q = ({where}){assumed}; {remedy}"
