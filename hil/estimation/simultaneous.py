"""Fit the parameters of all groups at once to condensed measurements (step 2, improved).

Measurements, periods and pieces are blocks (`hil.least_squares.blocks`) of the base parameters,
shared by all axes, and of the terms common to an axis's measurements (`hil.friction.equation`);
friction of each measurement alone is eliminated. Axes are weighted with the reciprocals of their
residual variances. The common terms are nuisances, except mu, the share of the transmitted torque
lost to friction. The transmitted torque is taken from a first solution without mu. Only axes with a
significant mu keep it: at small transmitted torques mu is hardly determined and would make all
other unknowns uncertain too. A common term without excitation stays zero.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import NotIdentifiable
from hil.estimation.condensed import (
    ROTOR,
    condensed_blocks,
    drive_torques,
    quantisation_bias,
    stack,
)
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
"""Smallest ratio of mu to its standard error of an axis with load friction."""


class SimultaneousFit:
    """Joint least squares over condensed measurements.

    Raises
    ------
    NotIdentifiable
        No measurement is usable.
    """

    def __init__(self, robot: Robot, prepared: Prepared) -> None:
        self._robot, self._n_joints = robot, robot.n_joints
        self._n_base = len(base_parameters(robot))
        self.stacked = [(s, axes) for m, s in prepared for axes in stack(robot, m, s)]
        """Signals of each measurement, with the columns of each moving axis."""
        if not self.stacked:
            raise NotIdentifiable(
                "0 usable measurements of gravity, inertia or coupling, and no usable period of a"
                " trajectory; measure some (see: hil plan)"
            )
        none = np.zeros(robot.n_joints, dtype=bool)
        self._take(none)
        p = self.without_load_friction = self.solve()
        """Base parameters from a fit without load friction, shape (n_base,)."""
        self.stacked = [
            (s, [each.loaded(each.load(p)) for each in axes]) for s, axes in self.stacked
        ]
        self._take(~none)
        # errors from the scores of the measurements
        fit = self.regression.fit("clusters")
        places = [place(robot, axis)[self._n_base + LOAD] for axis in range(robot.n_joints)]
        error = np.sqrt(np.diag(fit.covariance)[places].clip(0.0))
        shown = error > 0
        mu, error = (np.where(shown, each, np.nan) for each in (fit.x[places], error))
        self.load_friction = LoadFriction(mu, error)
        """Mu of every axis with standard error, from a fit with load friction on all axes."""
        self._keep(np.nan_to_num(mu / error) > SIGNIFICANT)
        while self.loaded.any() and self.undetermined().any():
            # with a constant load on an axis, load friction resembles gravity
            kept = np.flatnonzero(self.loaded)
            fewer = self.loaded.copy()
            fewer[kept[np.argmin((mu / error)[kept])]] = False
            self._keep(fewer)

    def _take(self, loaded: NDArray[np.bool_]) -> None:
        """Condense and weigh measurements, with load friction on some axes."""
        self.blocks = condensed_blocks(self._robot, [axes for _, axes in self.stacked])
        """Inner products of the measurements, with the rotor column among the shared columns."""
        self._keep(loaded)

    def _keep(self, loaded: NDArray[np.bool_]) -> None:
        """Weight the axes, with load friction on the axes of a mask only, shape (n_joints,)."""
        self.loaded = loaded
        """Axes with load friction, shape (n_joints,)."""
        blocks = self.blocks.drop(ROTOR)
        own = [COMMON if each else COMMON[:LOAD] for each in loaded]
        self.regression = Regression.weighed(blocks, blocks.layout.kept(own))
        """Solved regression; unknowns are base parameters and, axis by axis, the common terms."""

    @property
    def recorded(self) -> Blocks:
        """Blocks with load friction columns only for axes with load friction."""
        products, load = self.blocks.products.copy(), self.blocks.place(*COMMON[LOAD:])
        for axis in np.flatnonzero(~self.loaded):
            products[:, axis, load], products[:, axis, :, load] = 0.0, 0.0
        return replace(self.blocks, products=products)

    @property
    def n_measurements(self) -> int:
        """Number of measurements, or periods of trajectories."""
        return len(self.blocks)

    @property
    def shares(self) -> Normal:
        """Weighted equations by measurement, over all unknowns; zero for dropped unknowns."""
        whole = self.regression.blocks.normal(self.regression.weights)
        gone = np.setdiff1d(np.arange(whole.v.shape[1]), self.regression.kept)
        whole.N[:, gone], whole.N[:, :, gone], whole.v[:, gone] = 0.0, 0.0, 0.0
        return whole

    @property
    def weight(self) -> Array:
        """Reciprocal residual variance of each axis [1/(N m)^2]; 1 without measurements."""
        found = self.regression.weights
        return np.where(found > 0, found, 1.0)

    @property
    def residual(self) -> Array:
        """Root mean square torque residual of every axis, shape (n_joints,) [N m].

        Friction is fitted separately in each measurement. Torque ripple counts as residual: `solve`
        removes it from the base parameters, and no model predicts it. NaN without measurements.
        """
        blocks = self.regression.blocks
        asymmetric = tuple(COMMON[k] for k in ASYMMETRIC)
        kept = blocks.layout.kept([asymmetric] * self._n_joints)
        left = blocks.mean_squares(Regression(blocks, self.regression.weights, kept).solution)
        return np.where(blocks.counts.sum(axis=0) > 0, np.sqrt(left), np.nan)

    @property
    def n_base(self) -> int:
        """Number of base parameters."""
        return self._n_base

    @cached_property
    def information(self) -> Array:
        """Weighted information of the measurements, over the unknowns."""
        regression = self.regression
        whole = regression.blocks.total.normal(regression.weights).only(regression.kept)
        return embedded(whole.information, regression.kept, regression.layout.size)

    @property
    def noise_covariance(self) -> Array:
        """Covariance of the unknowns for white residuals."""
        return inverse(self.information)

    @property
    def solution(self) -> Array:
        """Estimated unknowns: base parameters and, axis by axis, the common terms."""
        return self.regression.solution

    def solve_without_asymmetry(self) -> Array:
        """Return base parameters with direction-independent friction, shape (n_base,)."""
        places = [place(self._robot, axis)[self._n_base :] for axis in range(self._n_joints)]
        ignored = np.concatenate([own[list(ASYMMETRIC)] for own in places])
        regression = replace(self.regression, kept=np.setdiff1d(self.regression.kept, ignored))
        return regression.solution[: self._n_base]

    def solve(self) -> Array:
        """Return the base parameters, shape (n_base,)."""
        return self.solution[: self._n_base]

    def information_of(self, share: Array) -> Array:
        """Return the information with every axis scaled by `share`, shape (n_joints,)."""
        return self.regression.blocks.total.normal(share * self.weight).information

    def undetermined(self) -> NDArray[np.bool_]:
        """Return a mask of undetermined base parameters, shape (n_base,)."""
        return undetermined_beside(self.information, self._n_base)

    def steps(self) -> tuple[Array, Array]:
        """Return the correction of p for encoder quantisation, and its covariance.

        If a control loop follows its encoder, the axis moves with the encoder steps, and no
        correction is needed; beyond the bandwidth of the loop the full correction is needed. The
        share needed is unknown between 0 and 1 for each axis: half the correction is applied, with
        the variance 1/12 of the share.
        """
        sides = np.zeros((len(self.information), self._n_joints))
        for axis, weight in enumerate(self.weight):
            own = [(s, each) for s, axes in self.stacked for each in axes if each.axis == axis]
            sides[: self._n_base] -= weight * quantisation_bias(
                self._robot, axis, self.solve(), own
            )
        effect = solved(self.information, sides)[: self._n_base]
        return effect.sum(axis=1) / 2, effect @ effect.T / 12

    def sensitivity(self) -> Array:
        """Return the change of p per relative change of torque constants, then rotor inertias."""
        blocks = self.blocks.total
        torques = (blocks.recast(each, dropped=(ROTOR,)) for each in drive_torques(blocks))
        effects = [self.regression.moved(each)[: self._n_base] for each in torques]
        return np.hstack(effects)


class Joint(NamedTuple):
    """Joint regression of strokes and trajectories with compensated drive trains.

    Attributes
    ----------
    prepared : sequence of (ParameterMotion, Signals)
        Measurements with compensated drive trains.
    rigid : ndarray, shape (n_base,)
        Base parameters from a fit without load friction.
    """

    solver: SimultaneousFit
    drive_train: DriveTrain
    prepared: Prepared
    rigid: Array
