"""Which position of which axis would show a parameter of the load that a measurement left rough.

Of all measurements that the load allows, the one is taken that lessens the predicted standard
deviation of the parameter most, beside what was measured. Then one axis at a time is turned that it
does not move: the one whose position matters most is the answer, at the position that is best.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.estimation.payload_figures import MASS
from hil.least_squares.terms import n_unknowns
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.design.candidates import judged
from hil.planning.design.load import embedded, embedding, of_load
from hil.planning.measurement import shows_parameters
from hil.results.load_plan import allowed, at_position, without_load

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.payload_figures import Payload
    from hil.planning.measurement import ParameterMeasurement
    from hil.planning.plan import Plan
    from hil.results.bare_run import BareRun

    Array = NDArray[np.float64]

STEP = math.radians(15)
"""Between positions of an axis that turns."""
PLACES = 9
"""Positions of an axis that slides."""
MATTERS = 1.2
"""Greatest over least deviation from which on the position of an axis matters."""
_TRIED = 40
"""Measurements, the most promising ones, whose torques are looked at."""


class Pose(NamedTuple):
    """What to measure again.

    Attributes
    ----------
    axis : int
        Number from 1 of the one to be held; of the one that moves where no position matters.
    position : float or None
        [rad or m]; None where no position matters.
    share : float
        Of the predicted standard deviation, with one such measurement more.
    """

    axis: int
    position: float | None
    share: float


def helpful_poses(
    bare: BareRun, plans: Sequence[Plan], found: Payload, names: Sequence[str]
) -> dict[str, Pose]:
    """Find the pose that would show each of the parameters `names` of the load.

    Parameters
    ----------
    plans : sequence of Plan
        What was measured.
    names : sequence of str
        As the robot file has them, without the link's number.
    """
    search = _Search(bare, plans, found)
    poses = {name: search.of(_column(bare, name)) for name in names}
    return {name: pose for name, pose in poses.items() if pose is not None}


def _column(bare: BareRun, name: str) -> int:
    return int(np.argmax(np.abs(bare.free[LINK_PARAMETERS.index(name)])))


class _Search:
    def __init__(self, bare: BareRun, plans: Sequence[Plan], found: Payload) -> None:
        self.bare, self.found = bare, found
        self.E, n = embedding(bare.robot, bare.shown), n_unknowns(bare.robot)
        self.load = slice(n, n + bare.shown.shape[1])
        self.options = allowed(bare)
        self.known = without_load(bare, self.options)
        for measurement in (m for plan in plans for m in plan.measurements):
            if shows_parameters(measurement):
                self.known = self.known + self.worth(measurement)

    def worth(self, measurement: ParameterMeasurement) -> Array:
        period, noise = self.bare.run.planned.sample_period, self.bare.levels.noise
        return embedded(judged(self.bare.robot, measurement, period, noise), self.E)

    def deviation(self, k: int, more: Array | float = 0.0) -> float:
        left = of_load(self.known + more, self.load)
        return float(np.sqrt(np.linalg.inv(left)[k, k]))

    def of(self, k: int) -> Pose | None:
        now = self.deviation(k)
        gains = [self.deviation(k, embedded(each.worth, self.E)) for each in self.options]
        best = [self.options[at] for at in np.argsort(gains)[:_TRIED]]
        fitting = allowed(self.bare, self.found, best)
        if not fitting:
            return None
        measurement = fitting[0].measurement
        still = [a for a in range(self.bare.robot.n_joints) if a not in measurement.moved]
        curves = [(a, *self._curve(k, measurement, a)) for a in still]
        axis, places, sizes = max(curves, key=lambda each: float(each[2].max() / each[2].min()))
        if sizes.max() < MATTERS * sizes.min():
            share = self.deviation(k, self.worth(measurement)) / now
            return Pose(measurement.moved[0] + 1, None, share)
        return Pose(axis + 1, float(places[np.argmin(sizes)]), float(sizes.min() / now))

    def _curve(self, k: int, measurement: ParameterMeasurement, axis: int) -> tuple[Array, Array]:
        """Positions of an axis, and the deviation with `measurement` there."""
        places = _positions(self.bare, axis)
        turned = (at_position(measurement, axis, float(at)) for at in places)
        return places, np.array([self.deviation(k, self.worth(each)) for each in turned])


def _positions(bare: BareRun, axis: int) -> Array:
    low, high = bare.robot.q_min[axis], bare.robot.q_max[axis]
    if not bare.robot.revolute[axis]:
        return np.linspace(low, high, PLACES)
    found: Array = STEP * np.arange(math.ceil(low / STEP), math.floor(high / STEP) + 1)
    return found


def parameter_of(figure: str) -> str:
    """Parameter that a figure of the load needs most: `Ixx` of `Ixx about the centre`."""
    return LINK_PARAMETERS[MASS] if figure == "mass" else figure.split(maxsplit=1)[0]
