"""Search for the axis position that best determines an imprecise load parameter.

From all measurements feasible with the load, the one with the largest decrease of the parameter's
predicted standard deviation is taken. Then the position of each axis at rest in this measurement is
varied. The result is the axis with the largest effect, at its best position.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.design.load import FoundLoad, WithoutLoad, feasible_options, hold_axis

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.planning.design.load import Worth
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.plan import Plan


STEP = math.radians(15)
"""Step between positions of a revolute axis."""


class Pose(NamedTuple):
    """Pose for another measurement of the load.

    Attributes
    ----------
    axis : int
        Axis to be held, from 1; if no position matters, the moving axis.
    position : float or None
        Position of the held axis [rad or m]; None if no position matters.
    share : float
        Predicted standard deviation after another measurement, relative to the present one.
    """

    axis: int
    position: float | None
    share: float


def helpful_poses(
    bare: WithoutLoad, plans: Sequence[Plan], found: FoundLoad, names: Sequence[str]
) -> dict[str, Pose]:
    """Find the pose that best shows each load parameter in `names`.

    Parameters
    ----------
    plans : sequence of Plan
        Plans measured so far.
    names : sequence of str
        Names as in the robot file, without the link's number; names absent there are ignored.
    """
    free = bare.columns.free
    columns = {name: free[LINK_PARAMETERS.index(name)] for name in names}
    search = _Search(bare, plans, found)
    poses = {
        name: search.best_pose(int(np.argmax(np.abs(row))))
        for name, row in columns.items()
        if row.any()
    }
    return {name: pose for name, pose in poses.items() if pose is not None}


class _Search:
    def __init__(self, bare: WithoutLoad, plans: Sequence[Plan], found: FoundLoad) -> None:
        self.bare, self.found = bare, found
        self.options = feasible_options(bare)
        self.known = bare.before(self.options, plans)

    def deviation(self, k: int, more: Worth = ()) -> float:
        left = self.bare.load_information(self.known + self.bare.embed(more))
        return float(np.sqrt(np.linalg.inv(left)[k, k]))

    def best_pose(self, k: int) -> Pose | None:
        now = self.deviation(k)
        gains = [self.deviation(k, each.worth) for each in self.options]
        # torques are checked only for the 40 most promising measurements, for speed
        best = [self.options[at] for at in np.argsort(gains)[:40]]
        fitting = feasible_options(self.bare, self.found, best)
        if not fitting:
            return None
        measurement = fitting[0].measurement
        still = [a for a in range(self.bare.robot.n_joints) if a not in measurement.moved]
        curves = [(a, *self._curve(k, measurement, a)) for a in still]
        axis, places, sizes = max(curves, key=lambda each: float(each[2].max() / each[2].min()))
        # an axis's position matters if it changes the deviation by a fifth
        if sizes.max() < 1.2 * sizes.min():
            share = self.deviation(k, self.bare.judge(measurement)) / now
            return Pose(measurement.moved[0] + 1, None, share)
        return Pose(axis + 1, float(places[np.argmin(sizes)]), float(sizes.min() / now))

    def _curve(self, k: int, measurement: ParameterMeasurement, axis: int) -> tuple[Array, Array]:
        """Return positions of an axis, and the standard deviation after `measurement` at each."""
        low, high = self.bare.robot.q_min[axis], self.bare.robot.q_max[axis]
        places: Array = STEP * np.arange(math.ceil(low / STEP), math.floor(high / STEP) + 1)
        if not self.bare.robot.revolute[axis]:
            places = np.linspace(low, high, 9)
        turned = (hold_axis(measurement, axis, float(at)) for at in places)
        return places, np.array([self.deviation(k, self.bare.judge(each)) for each in turned])
