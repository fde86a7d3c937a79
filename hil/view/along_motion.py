"""What is computed along a motion: torques by a model, and which link is nearest to which box.

Distances are by what the safety check computes with. The check bounds them between the instants too
(`hil.planning.clearance`); here they are those of the capsules at the instants themselves.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import FrictionUnknown
from hil.planning.clearance import intrusions
from hil.view.packed import INSTANT, Track, all_simplified

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.model.robot import Robot
    from hil.planning.workspace import Workspace
    from hil.results.model import Model


class Predicted(NamedTuple):
    """Torque of each joint, and what it consists of."""

    tracks: tuple[Track, ...]
    words: str


def predicted(model: Model, time: Array, q: Array, qd: Array, qdd: Array) -> Predicted:
    """Predict the torques at instants (n,) of a motion (n, n_joints)."""
    parts = _parts(len(time))
    lack, n = model.axes_without_friction, model.robot.n_joints
    if len(lack) == n:
        torque = [model.torque(q[p], qd[p], qdd[p], ("rigid bodies", "motors")) for p in parts]
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FrictionUnknown)  # the words say so
            torque = [model.drive_torque(q[p], qd[p], qdd[p]) for p in parts]
    of = "" if len(lack) == n else f" of axis {', '.join(map(str, lack))}"
    words = f"predicted, without friction{of}" if lack else "predicted"
    return Predicted(all_simplified(time, np.concatenate(torque)), words)


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
        """As a page has it, to a tenth of a millimetre."""
        numbers = {"link": self.link.tolist(), "box": self.box.tolist()}
        return self.track.data(1e-4) | numbers

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
    parts = [_nearest(robot, workspace, q[part]) for part in _parts(len(q))]
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


def _parts(n: int, most: int = 4096) -> list[slice]:
    """Parts of n instants that are computed at a time."""
    return [slice(begin, begin + most) for begin in range(0, n, most)]
