"""Step 2, improved: all groups at once from the condensed measurements.

The information of all measurements is added up, each axis weighted with the reciprocal of its
residual variance, which is found by solving a few times over. Unknown are the base parameters and,
for each axis, the terms common to its measurements (`condensed`); the latter are nuisance, but for
one: mu, the share of the transmitted torque that is friction. What the gears transmit is taken from
a first solution without it. Only axes whose mu is significant keep it: where little torque is
transmitted it is hardly known and would make everything else uncertain too. A common term that
nothing excites stays zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.condensed import Condensed, stack
from hil.estimation.drive_train import LoadFriction
from hil.model.base_parameters import base_parameters
from hil.regression.least_squares import inverse, solved, undetermined_beside
from hil.regression.terms import LOAD, n_unknowns, place
from hil.regression.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Array = NDArray[np.float64]

SIGNIFICANT = 2.0
"""Mu over its standard error from which on an axis keeps it."""
_ROUNDS = 3
"""Times that weights and solution are found from each other."""


class SimultaneousFit:
    """Joint least squares over condensed measurements.

    Raises
    ------
    NotIdentifiable
        None of them can be used.
    """

    def __init__(self, robot: Robot, prepared: Sequence[tuple[ParameterMotion, Signals]]) -> None:
        self._robot, self._n_joints = robot, robot.n_joints
        self._n_base = len(base_parameters(robot))
        self._weight = np.ones(robot.n_joints)
        stacks = [(s, axes) for m, s in prepared for axes in stack(robot, m, s)]
        if not stacks:
            raise NotIdentifiable(
                "0 usable measurements of gravity, inertia or coupling, and no usable period of a"
                " trajectory; measure some (see: hil plan)"
            )
        self._items = [[each.condensed() for each in axes] for _, axes in stacks]
        self._weigh()
        rigid, p = self._items, self.solve()
        self.without_load_friction = p
        """Base parameters where friction of the load is ignored, shape (n_base,)."""
        loaded = [(s, [each.loaded(each.load(p)) for each in axes]) for s, axes in stacks]
        self._items = [[each.condensed() for each in axes] for _, axes in loaded]
        self._weigh()
        self.load_friction = self._load_friction()
        """Mu of every axis with its standard error, were all of them kept."""
        mu, error = self.load_friction
        self.loaded: NDArray[np.bool_] = np.nan_to_num(mu / error) > SIGNIFICANT
        """Axes that keep it, shape (n_joints,)."""
        both = [list(zip(*each, strict=True)) for each in zip(self._items, rigid, strict=True)]
        self._keep_load_friction(both)
        while self.loaded.any() and self.undetermined().any():
            # where an axis always carries the same load, its friction looks like gravity
            kept = np.flatnonzero(self.loaded)
            self.loaded[kept[np.argmin((mu / error)[kept])]] = False
            self._keep_load_friction(both)
        self.stacked = [
            (s, [b if self.loaded[b.axis] else a for a, b in zip(plain, other, strict=True)])
            for (s, plain), (_, other) in zip(stacks, loaded, strict=True)
        ]
        """Of each measurement its signals and the columns of each axis that moves."""

    def _keep_load_friction(self, both: Sequence[Sequence[tuple[Condensed, Condensed]]]) -> None:
        """Take each axis's share with or without friction of the load, as `loaded` says."""
        self._items = [
            [with_mu if self.loaded[with_mu.axis] else without for with_mu, without in each]
            for each in both
        ]
        self._weigh()

    @property
    def n_measurements(self) -> int:
        """How many measurements, or periods of trajectories, there are to leave out."""
        return len(self._items)

    @property
    def shares(self) -> Sequence[tuple[Array, Array]]:
        """Weighted information and vector of each measurement, over all unknowns.

        These are the base parameters and then, axis by axis, the common terms.
        """
        return self._shares

    @property
    def items(self) -> Sequence[Sequence[Condensed]]:
        """The condensed measurements."""
        return self._items

    @property
    def weight(self) -> Array:
        """Reciprocal of each axis's residual variance, shape (n_joints,) [1/(N m)^2]."""
        return self._weight

    @property
    def n_base(self) -> int:
        """How many base parameters there are."""
        return self._n_base

    @property
    def information(self) -> Array:
        """Weighted information of all measurements, over all unknowns."""
        return self._sum[0]

    @property
    def noise_covariance(self) -> Array:
        """Covariance of all unknowns if the residuals were white noise."""
        return inverse(self.information)

    @property
    def solution(self) -> Array:
        """All unknowns: base parameters and, axis by axis, the common terms."""
        return solved(*self._sum)

    def without_terms(self, terms: Sequence[int]) -> Array:
        """Base parameters where some of the axes' common terms are ignored, shape (n_base,)."""
        information, vector = (each.copy() for each in self._sum)
        for axis in range(self._n_joints):
            at = place(self._robot, axis)[self._n_base + np.array(terms)]
            information[at], information[:, at], vector[at] = 0.0, 0.0, 0.0
        return solved(information, vector)[: self._n_base]

    def solve(self, without: int | None = None) -> Array:
        """Base parameters, shape (n_base,)."""
        information, vector = self._sum
        if without is not None:
            information = information - self._shares[without][0]
            vector = vector - self._shares[without][1]
        return solved(information, vector)[: self._n_base]

    def information_of(self, share: Array) -> Array:
        """Information of all measurements with each axis's times `share`, shape (n_joints,)."""
        return self._added_up(self._axes(), share * self._weight)[0]

    def undetermined(self) -> NDArray[np.bool_]:
        """Base parameters that all measurements together leave open, shape (n_base,)."""
        return undetermined_beside(self.information, self._n_base)

    def _load_friction(self) -> LoadFriction:
        """Mu of every axis, with its standard error from the measurements' scores."""
        vector = self._sum[1]
        root = self.noise_covariance
        places = [place(self._robot, axis)[self._n_base + LOAD] for axis in range(self._n_joints)]
        x = root @ vector
        scores = np.array([v - N @ x for N, v in self._shares])
        error = np.sqrt(np.diag(sandwich(root[places], scatter(scores))))
        shown = error > 0
        return LoadFriction(np.where(shown, x[places], np.nan), np.where(shown, error, np.nan))

    def sensitivity(self) -> Array:
        """Change of p per relative change of torque constants and rotor inertias."""
        n = len(self._sum[1])
        sides = np.zeros((n, 2 * self._n_joints))
        for item in (item for items in self._items for item in items):
            at, weight = place(self._robot, item.axis), self._weight[item.axis]
            sides[at, item.axis] += weight * (item.vector + item.motor)
            sides[at, self._n_joints + item.axis] -= weight * item.motor
        return solved(self._sum[0], sides)[: self._n_base]

    def _weigh(self) -> None:
        """Weights and solution from each other, and what each measurement says under them."""
        axes = self._axes()
        for _ in range(_ROUNDS):
            variance = self._residual_variance(axes, solved(*self._added_up(axes)))
            self._weight = 1.0 / np.where(variance > 0, variance, 1.0)
        self._sum = self._added_up(axes)
        self._shares = [self._added_up(items) for items in self._items]

    def _axes(self) -> list[Condensed]:
        """All measurements of each axis as one."""
        every = [item for items in self._items for item in items]
        found = []
        for axis in sorted({item.axis for item in every}):
            own = [item for item in every if item.axis == axis]
            product = np.sum([item.product for item in own], axis=0)
            found.append(Condensed(axis, product, sum(item.n for item in own)))
        return found

    def _added_up(
        self, items: Sequence[Condensed], weight: Array | None = None
    ) -> tuple[Array, Array]:
        """Information and vector of `items`, over all unknowns; weighted as the fit is."""
        n, weight = n_unknowns(self._robot), self._weight if weight is None else weight
        information, vector = np.zeros((n, n)), np.zeros(n)
        for item in items:
            at = place(self._robot, item.axis)
            information[np.ix_(at, at)] += weight[item.axis] * item.information
            vector[at] += weight[item.axis] * item.vector
        return information, vector

    def _residual_variance(self, axes: Sequence[Condensed], solution: Array) -> Array:
        variance = np.zeros(self._n_joints)
        for each in axes:
            x = solution[place(self._robot, each.axis)]
            square = float(each.square - 2 * each.vector @ x + x @ each.information @ x)
            variance[each.axis] = max(square, 0.0) / max(each.n, 1)
        return variance
