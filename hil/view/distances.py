"""Which link is nearest to which box along a motion, by what the safety check computes with.

The check bounds the distance between the instants too (`hil.planning.clearance`); here it is that
of the capsules at the instants themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.planning.clearance import intrusions
from hil.view.track import INSTANT, Track

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace

    Array = NDArray[np.float64]

MILLIMETRE = 1e-3
_CHUNK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class Distances:
    """The least distance of any capsule to any box.

    Attributes
    ----------
    track : Track
        [m]; negative by how far a capsule reaches into a box.
    link, box : array (n,)
        Between which it is, from 0.
    """

    track: Track
    link: NDArray[np.intp]
    box: NDArray[np.intp]

    def data(self) -> dict[str, object]:
        """As a page has it."""
        numbers = {"link": self.link.tolist(), "box": self.box.tolist()}
        return self.track.data(MILLIMETRE / 10) | numbers

    @property
    def least(self) -> int:
        """Number of the instant at which the distance is smallest."""
        return int(self.track.value.argmin())


def distances(robot: Robot, workspace: Workspace | None, time: Array, q: Array) -> Distances | None:
    """Find the distances at configurations q (n, n_joints); None where there is nothing to be near.

    Parameters
    ----------
    time : array (n,)
        Instants [s].
    """
    if workspace is None or not workspace.boxes:
        return None
    parts = [
        _nearest(robot, workspace, q[begin : begin + _CHUNK]) for begin in range(0, len(q), _CHUNK)
    ]
    distance, nearest = (np.concatenate(each) for each in zip(*parts, strict=True))
    if not np.isfinite(distance).all():
        return None
    link, box = np.divmod(nearest, len(workspace.boxes))
    return Distances(Track(time, distance), link, box)


def smallest(found: Distances, workspace: Workspace) -> str:
    """Return the smallest distance in words: between what, and when."""
    at, depth = found.least, found.track.value[found.least]
    name = workspace.boxes[int(found.box[at])].name
    where = f"link {found.link[at] + 1}, {round(found.track.time[at] / INSTANT) * INSTANT:.1f} s"
    if depth < 0:
        return f"a link reaches {-depth:.3f} m into {name} ({where} after the beginning)"
    return f"smallest distance to a box: {depth:.3f} m to {name} ({where} after the beginning)"


def _nearest(robot: Robot, workspace: Workspace, q: Array) -> tuple[Array, NDArray[np.intp]]:
    """Least distance at each configuration, and the number of its link and box."""
    free = workspace.margin - intrusions(robot, workspace, q).reshape(len(q), -1)
    nearest = free.argmin(axis=1)
    return free[np.arange(len(q)), nearest], nearest
