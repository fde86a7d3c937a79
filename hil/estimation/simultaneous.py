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
from hil.estimation.condensed import MOTOR, stack
from hil.estimation.drive_train import LoadFriction
from hil.model.base_parameters import base_parameters
from hil.regression.least_squares import inverse, solved, undetermined_beside
from hil.regression.normal_equations import normal, reweighted
from hil.regression.terms import LOAD, N_COMMON, place
from hil.regression.uncertainty import sandwich, scatter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Condensed
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion
    from hil.regression.normal_equations import Normal

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
    def shares(self) -> Normal:
        """Weighted equations by measurement, over all unknowns.

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
        return self._sum.information

    @property
    def noise_covariance(self) -> Array:
        """Covariance of all unknowns if the residuals were white noise."""
        return inverse(self.information)

    @property
    def solution(self) -> Array:
        """All unknowns: base parameters and, axis by axis, the common terms."""
        return self._sum.solution()

    def without_terms(self, terms: Sequence[int]) -> Array:
        """Base parameters where some of the axes' common terms are ignored, shape (n_base,)."""
        information, vector = self._sum.information, self._sum.vector
        for axis in range(self._n_joints):
            at = place(self._robot, axis)[self._n_base + np.array(terms)]
            information[at], information[:, at], vector[at] = 0.0, 0.0, 0.0
        return solved(information, vector)[: self._n_base]

    def solve(self, without: int | None = None) -> Array:
        """Base parameters, shape (n_base,)."""
        information, vector = self._sum.information, self._sum.vector
        if without is not None:
            information = information - self._shares.N[without]
            vector = vector - self._shares.v[without]
        return solved(information, vector)[: self._n_base]

    def information_of(self, share: Array) -> Array:
        """Information of all measurements with each axis's times `share`, shape (n_joints,)."""
        return normal(self._total, self._n_base, share * self._weight).information

    def undetermined(self) -> NDArray[np.bool_]:
        """Base parameters that all measurements together leave open, shape (n_base,)."""
        return undetermined_beside(self.information, self._n_base)

    def _load_friction(self) -> LoadFriction:
        """Mu of every axis, with its standard error from the measurements' scores."""
        root = self.noise_covariance
        places = [place(self._robot, axis)[self._n_base + LOAD] for axis in range(self._n_joints)]
        x = root @ self._sum.vector
        error = np.sqrt(np.diag(sandwich(root[places], scatter(self._shares.scores(x)))))
        shown = error > 0
        return LoadFriction(np.where(shown, x[places], np.nan), np.where(shown, error, np.nan))

    def sensitivity(self) -> Array:
        """Change of p per relative change of torque constants and rotor inertias."""
        sides = np.zeros((len(self.information), 2 * self._n_joints))
        for item in (item for items in self._items for item in items):
            at, weight = place(self._robot, item.axis), self._weight[item.axis]
            sides[at, item.axis] += weight * (item.vector + item.motor)
            sides[at, self._n_joints + item.axis] -= weight * item.motor
        return solved(self.information, sides)[: self._n_base]

    def _weigh(self) -> None:
        """Weights and solution from each other, and what each measurement says under them."""
        products, counts = self._products()
        # all of each axis at once, which is all that weights take
        total, count = (each.sum(axis=0, keepdims=True) for each in (products, counts))

        def weigh(weights: Array) -> Array:
            x = normal(total, self._n_base, weights).solution()
            variance = self._residual_variance(total[0], count[0], x)
            return np.asarray(1.0 / np.where(variance > 0, variance, 1.0))

        self._weight = reweighted(weigh, self._weight, _ROUNDS, None)
        self._total = total
        self._sum = normal(total, self._n_base, self._weight)
        self._shares = normal(products, self._n_base, self._weight)

    def _products(self) -> tuple[Array, Array]:
        """Inner products of torque and columns by measurement and axis, and samples behind them."""
        width = 1 + self._n_base + N_COMMON
        products = np.zeros((len(self._items), self._n_joints, width, width))
        counts = np.zeros((len(self._items), self._n_joints))
        for k, items in enumerate(self._items):
            for item in items:
                products[k, item.axis] = item.without(np.array([MOTOR])).product
                counts[k, item.axis] = item.n
        return products, counts

    def _residual_variance(self, total: Array, count: Array, solution: Array) -> Array:
        """Mean square of what a solution leaves of each axis's torque, shape (n_joints,)."""
        squares = np.zeros(self._n_joints)
        for axis, own in enumerate(total):
            x = solution[place(self._robot, axis)]
            squares[axis] = own[0, 0] - 2 * own[1:, 0] @ x + x @ own[1:, 1:] @ x
        return np.asarray(np.maximum(squares, 0.0) / np.maximum(count, 1.0))
