"""Greedy selection of measurements by information gain per second.

With the information N of the measurements chosen so far, over base parameters p and common terms b,
adding a measurement with information I changes

det
    log det of the information of p, b eliminated: log det(N) - log det(N_bb). Its growth is a ratio
    of two small determinants, since a measurement touches one or two axes (Fedorov, *Theory of
    Optimal Experiments*, 1972);
torque
    the variance of torques, sum of (scale sd)^2 over the parameters: imprecise parameters with a
    large torque count most.

Both criteria are divided by the duration of the measurement and of the travel from the nearest
chosen one, since a tour of many measurements goes from neighbour to neighbour.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from hil.friction.equation import n_unknowns
from hil.least_squares.solving import solved
from hil.model.base_parameters import base_parameters
from hil.planning.design.tour import TRAVEL
from hil.planning.prediction.precision import torque_scale
from hil.planning.timetable import SETTLING, travel_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.model.robot import Robot
    from hil.planning.design.candidates import Option
    from hil.planning.measurement import ParameterMeasurement


SelectionCriterion = Literal["det", "torque"]


class Selection:
    """Chosen options, and the gains of the remaining options.

    Parameters
    ----------
    robot : Robot
    options : sequence of Option
    criterion : {"det", "torque"}
    known : ndarray, shape (n, n), optional
        Information of earlier measurements.
    """

    def __init__(
        self,
        robot: Robot,
        options: Sequence[Option],
        criterion: SelectionCriterion = "det",
        known: Array | None = None,
    ) -> None:
        self._robot, self._criterion = robot, criterion
        self._n_base = len(base_parameters(robot))
        self._scale = torque_scale(robot)
        self._starts = np.array([option.measurement.start for option in options])
        self._durations = np.array([option.measurement.duration for option in options])
        joints = range(robot.n_joints)
        self._moves = np.array([[j in each.measurement.moved for j in joints] for each in options])
        self._blocks = _blocks(options)
        self._information = _prior(options, n_unknowns(robot))
        if known is not None:
            self._information += known
        self._options = options
        self._worth = [option.worth for option in options]
        self._free = np.ones(len(options), dtype=bool)
        self._way = np.full(len(options), np.inf)
        self.chosen: list[int] = []
        self.duration = 0.0
        """Estimated duration of the chosen options, travels included [s]."""

    @property
    def measurements(self) -> list[ParameterMeasurement]:
        """Chosen measurements, in the order of choice."""
        return [self._options[number].measurement for number in self.chosen]

    def take(self, number: int) -> None:
        """Choose option `number`."""
        self.duration += float(self._costs()[number])
        for at, worth in self._worth[number]:
            self._information[np.ix_(at, at)] += worth
        way = travel_times(self._robot, self._starts[number], self._starts, TRAVEL)
        self._way = np.minimum(self._way, way)
        self._free[number] = False
        if not self._free.any():
            self._free[:] = True
        self.chosen.append(number)

    def take_best(self, axis: int | None = None) -> None:
        """Choose the option with the largest gain per second, among those moving `axis` if given.

        If no option moves `axis`, nothing is chosen.
        """
        wanted = self._free if axis is None else self._moves[:, axis] & self._free
        if axis is not None and not wanted.any():
            wanted = self._moves[:, axis]
        if wanted.any():
            rate = self.gains() / self._costs()
            self.take(int(np.argmax(np.where(wanted, rate, -np.inf))))

    def gains(self) -> Array:
        """Compute the gain of every option in the criterion, shape (n_options,)."""
        inverse = solved(self._information, np.eye(len(self._information)))
        nuisance = self._information[self._n_base :, self._n_base :]
        common = solved(nuisance, np.eye(len(nuisance)))
        found = np.empty(len(self._worth))
        for at, numbers, worth in self._blocks:
            if self._criterion == "det":
                found[numbers] = self._growth(at, worth, inverse, common)
            else:
                found[numbers] = self._relief(at, worth, inverse)
        return found

    def _growth(self, at: Indices, worth: Array, inverse: Array, common: Array) -> Array:
        """Compute the growth of log det for options with unknowns `at`."""
        unit = np.eye(len(at))
        inner = at >= self._n_base
        own = at[inner] - self._n_base
        _, whole = np.linalg.slogdet(unit + worth @ inverse[np.ix_(at, at)])
        nuisance = worth[:, inner][:, :, inner] @ common[np.ix_(own, own)]
        _, part = np.linalg.slogdet(np.eye(len(own)) + nuisance)
        growth: Array = whole - part
        return growth

    def _relief(self, at: Indices, worth: Array, inverse: Array) -> Array:
        """Compute the relative decrease in the variance of torques."""
        rows = self._scale[:, np.newaxis] * inverse[: self._n_base, at]
        inside = np.linalg.solve(np.eye(len(at)) + worth @ inverse[np.ix_(at, at)], worth)
        fall: Array = np.einsum("ki,nij,kj->n", rows, inside, rows, optimize=True)
        variance = self._scale**2 @ np.diag(inverse)[: self._n_base]
        return fall / variance

    def _costs(self) -> Array:
        """Return the duration of every option, travel included [s]."""
        way = np.where(np.isfinite(self._way), self._way, 0.0)
        return self._durations + way + SETTLING


def _blocks(options: Sequence[Option]) -> list[tuple[Indices, Indices, Array]]:
    """Group options by unknowns: unknowns, option numbers, information."""
    touched: dict[tuple[int, ...], list[int]] = {}
    for number, option in enumerate(options):
        unknowns = sorted({int(k) for its, _ in option.worth for k in its})
        touched.setdefault(tuple(unknowns), []).append(number)
    found = []
    for key, numbers in touched.items():
        at: Indices = np.array(key, dtype=np.intp)
        worth: Array = np.zeros((len(numbers), len(at), len(at)))
        for row, number in enumerate(numbers):
            for its, matrix in options[number].worth:
                inside = np.searchsorted(at, its)
                worth[row][np.ix_(inside, inside)] += matrix
        found.append((at, np.array(numbers, dtype=np.intp), worth))
    return found


def _prior(options: Sequence[Option], n: int) -> Array:
    """Return a prior small enough to be negligible, large enough for finite determinants."""
    diagonal = np.zeros(n)
    for option in options:
        for at, worth in option.worth:
            diagonal[at] += np.diag(worth) / len(options)
    # negligible information: a millionth of the mean option's
    return np.diag(np.where(diagonal > 0, 1e-6 * diagonal, 1.0))
