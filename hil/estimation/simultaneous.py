"""Step 2, improved: all groups at once from the condensed measurements.

Measurements, periods and pieces are blocks (`hil.least_squares.blocks`) of the base parameters,
which all axes share, and of the terms common to an axis's measurements (`hil.friction.equation`);
friction of each measurement alone is eliminated. Axes are weighted with the reciprocals of their
residual variances. The common terms are nuisance, but for one: mu, the share of the transmitted
torque that is friction. What the gears transmit is taken from a first solution without it. Only
axes whose mu is significant keep it: where little torque is transmitted it is hardly known and
would make everything else uncertain too. A common term that nothing excites stays zero.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.condensed import ROTOR, condensed_blocks, drive_torques, of_steps, stack
from hil.estimation.drive_train import LoadFriction
from hil.friction.equation import ASYMMETRIC, COMMON, LOAD, place
from hil.least_squares.layout import embedded
from hil.least_squares.regression import Regression
from hil.least_squares.solving import inverse, solved, undetermined_beside
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.drive_train import DriveTrain
    from hil.estimation.signals import Prepared
    from hil.least_squares.blocks import Blocks
    from hil.least_squares.normal_equations import Normal
    from hil.model.robot import Robot


SIGNIFICANT = 2.0
"""Mu over its standard error from which on an axis keeps it."""


class SimultaneousFit:
    """Joint least squares over condensed measurements.

    Raises
    ------
    NotIdentifiable
        None of them can be used.
    """

    def __init__(self, robot: Robot, prepared: Prepared) -> None:
        self._robot, self._n_joints = robot, robot.n_joints
        self._n_base = len(base_parameters(robot))
        self.stacked = [(s, axes) for m, s in prepared for axes in stack(robot, m, s)]
        """Of each measurement its signals and the columns of each axis that moves."""
        if not self.stacked:
            raise NotIdentifiable(
                "0 usable measurements of gravity, inertia or coupling, and no usable period of a"
                " trajectory; measure some (see: hil plan)"
            )
        none = np.zeros(robot.n_joints, dtype=bool)
        self._take(none)
        p = self.without_load_friction = self.solve()
        """Base parameters where friction of the load is ignored, shape (n_base,)."""
        self.stacked = [
            (s, [each.loaded(each.load(p)) for each in axes]) for s, axes in self.stacked
        ]
        self._take(~none)
        self.load_friction = self._load_friction()
        """Mu of every axis with its standard error, were all of them kept."""
        mu, error = self.load_friction
        self._keep(np.nan_to_num(mu / error) > SIGNIFICANT)
        while self.loaded.any() and self.undetermined().any():
            # where an axis always carries the same load, its friction looks like gravity
            kept = np.flatnonzero(self.loaded)
            fewer = self.loaded.copy()
            fewer[kept[np.argmin((mu / error)[kept])]] = False
            self._keep(fewer)

    def _take(self, loaded: NDArray[np.bool_]) -> None:
        """Condense all measurements and weigh them, friction of the load on some axes."""
        self.blocks = condensed_blocks(self._robot, [axes for _, axes in self.stacked])
        """Their inner products, that with the motor's part among the shared columns."""
        self._keep(loaded)

    def _keep(self, loaded: NDArray[np.bool_]) -> None:
        """Weigh with friction of the load on some axes alone, shape (n_joints,)."""
        self.loaded = loaded
        """Axes that keep it, shape (n_joints,)."""
        blocks = self.blocks.drop(ROTOR)
        own = [COMMON if each else COMMON[:LOAD] for each in loaded]
        self.regression = Regression.weighed(blocks, blocks.layout.kept(own))
        """What is solved; its unknowns are base parameters and, axis by axis, the common terms."""

    @property
    def recorded(self) -> Blocks:
        """The blocks with columns of friction of the load on axes that keep it alone."""
        products, load = self.blocks.products.copy(), self.blocks.place(*COMMON[LOAD:])
        for axis in np.flatnonzero(~self.loaded):
            products[:, axis, load], products[:, axis, :, load] = 0.0, 0.0
        return replace(self.blocks, products=products)

    @property
    def n_measurements(self) -> int:
        """How many measurements, or periods of trajectories, there are to leave out."""
        return len(self.blocks)

    @property
    def shares(self) -> Normal:
        """Weighted equations by measurement, over all unknowns; zero of those that are not kept."""
        whole = self.regression.blocks.normal(self.regression.weights)
        gone = np.setdiff1d(np.arange(whole.v.shape[1]), self.regression.kept)
        whole.N[:, gone], whole.N[:, :, gone], whole.v[:, gone] = 0.0, 0.0, 0.0
        return whole

    @property
    def weight(self) -> Array:
        """Reciprocal of each axis's residual variance [1/(N m)^2]; 1 where nothing was measured."""
        found = self.regression.weights
        return np.where(found > 0, found, 1.0)

    @property
    def residual(self) -> Array:
        """Root mean square of what a model leaves of each axis's torque, shape (n_joints,) [N m].

        Friction is fitted anew each time. Torque ripple counts as residual: `solve` takes it out of
        the base parameters, and no model predicts it. NaN where nothing was measured.
        """
        blocks = self.regression.blocks
        asymmetric = tuple(COMMON[k] for k in ASYMMETRIC)
        kept = blocks.layout.kept([asymmetric] * self._n_joints)
        left = blocks.mean_squares(Regression(blocks, self.regression.weights, kept).solution)
        return np.where(blocks.counts.sum(axis=0) > 0, np.sqrt(left), np.nan)

    @property
    def n_base(self) -> int:
        """How many base parameters there are."""
        return self._n_base

    @cached_property
    def information(self) -> Array:
        """Weighted information of all measurements, over all unknowns."""
        regression = self.regression
        whole = regression.blocks.total.normal(regression.weights).only(regression.kept)
        return embedded(whole.information, regression.kept, regression.layout.size)

    @property
    def noise_covariance(self) -> Array:
        """Covariance of all unknowns if the residuals were white noise."""
        return inverse(self.information)

    @property
    def solution(self) -> Array:
        """All unknowns: base parameters and, axis by axis, the common terms."""
        return self.regression.solution

    def without_asymmetry(self) -> Array:
        """Base parameters where friction is taken for the same both ways, shape (n_base,)."""
        places = [place(self._robot, axis)[self._n_base :] for axis in range(self._n_joints)]
        ignored = np.concatenate([own[list(ASYMMETRIC)] for own in places])
        regression = replace(self.regression, kept=np.setdiff1d(self.regression.kept, ignored))
        return regression.solution[: self._n_base]

    def solve(self) -> Array:
        """Base parameters, shape (n_base,)."""
        return self.solution[: self._n_base]

    def information_of(self, share: Array) -> Array:
        """Information of all measurements with each axis's times `share`, shape (n_joints,)."""
        return self.regression.blocks.total.normal(share * self.weight).information

    def undetermined(self) -> NDArray[np.bool_]:
        """Base parameters that all measurements together leave open, shape (n_base,)."""
        return undetermined_beside(self.information, self._n_base)

    def steps(self) -> tuple[Array, Array]:
        """Change of p by what encoders' steps add to the equations, and its covariance.

        Where a loop follows its encoder, the axis moves as its steps say, and nothing is to be
        taken off; beyond the bandwidth of the loop all of it. Nothing shows the share of an axis,
        so it is any from 0 to 1: half is taken off, with the variance 1/12 of the share.
        """
        sides = np.zeros((len(self.information), self._n_joints))
        for axis, weight in enumerate(self.weight):
            own = [(s, each) for s, axes in self.stacked for each in axes if each.axis == axis]
            sides[: self._n_base] -= weight * of_steps(self._robot, axis, self.solve(), own)
        effect = solved(self.information, sides)[: self._n_base]
        return effect.sum(axis=1) / 2, effect @ effect.T / 12

    def _load_friction(self) -> LoadFriction:
        """Mu of every axis with its standard error from the measurements' scores."""
        fit = self.regression.fit("clusters")
        places = [place(self._robot, axis)[self._n_base + LOAD] for axis in range(self._n_joints)]
        error = np.sqrt(np.diag(fit.covariance)[places].clip(0.0))
        shown = error > 0
        return LoadFriction(np.where(shown, fit.x[places], np.nan), np.where(shown, error, np.nan))

    def sensitivity(self) -> Array:
        """Change of p per relative change of torque constants and rotor inertias."""
        blocks = self.blocks.total
        torques = (blocks.recast(each, dropped=(ROTOR,)) for each in drive_torques(blocks))
        effects = [self.regression.moved(each)[: self._n_base] for each in torques]
        return np.hstack(effects)


class Joint(NamedTuple):
    """Measurements of strokes and trajectories as one regression, drive trains compensated.

    Attributes
    ----------
    solver : SimultaneousFit
    drive_train : DriveTrain
    prepared : sequence of (ParameterMotion, Signals)
        With the drive trains taken into account.
    rigid : ndarray, shape (n_base,)
        Base parameters before anything was known of friction of the load.
    """

    solver: SimultaneousFit
    drive_train: DriveTrain
    prepared: Prepared
    rigid: Array
