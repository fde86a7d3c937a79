"""Friction after a reversal: its direction follows over a distance, not at once.

Surfaces that touch bend their asperities before they slide, so that friction turns round over the
presliding distance d. Dahl's model has its direction z, from -1 to 1, follow the way alone,

    dz / dq = (1 - z sign(dq)) / d,      z = s - (s - z_0) exp(-|q - q_0| / d)

while the axis moves in direction s from q_0 on, where it was z_0 (P. R. Dahl, Solid friction
damping of mechanical vibrations, AIAA Journal 14 (1976) 1675-1682). With d = 0 it is the sign of
the velocity. A slow or small motion is full of reversals: what the sign gets wrong there looks like
inertia.

The distance is what predicts held-out blocks of its axis best, all else being linear; the sign of
the velocity, unless that is worse by more than chance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.columns import coupled_friction, rotor_torque, shared_names
from hil.estimation.free_motion.motion import filtered_motion
from hil.least_squares.blocks import Blocks
from hil.least_squares.choice import HeldOut, simplest
from hil.least_squares.normal_equations import successive
from hil.least_squares.regression import Regression
from hil.model.dynamics import regressor

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.free_motion.motion import Motion, Processing
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot


DISTANCES = tuple(2.0**k for k in range(-18, -9))
"""That are tried first, as ways at the axis's speed [s]."""
FINER = (2.0**-0.5, 2.0**0.5)
"""Times the best of them: tried then."""
BLOCKS = 24
"""Of a stretch, at most."""
FRICTION = ("offset", "viscous", "cube root", "Coulomb")
"""Terms of each axis's friction, the one that follows the direction last."""
SHORTEST = 10.0
"""Of a block, in periods of the equation's cut-off frequency."""


def with_presliding(robot: Robot, found: Survey, processing: Processing) -> Processing:
    """Settings with the presliding distance of every axis that moves.

    Where gains are unknown there is none: axes that share parameters cannot be fitted together yet.
    """
    distances = np.zeros(robot.n_joints)
    motions = [filtered_motion(each, processing) for each in found.stretches]
    motions = [motion for motion in motions if motion.used.any()]
    if found.unknown_gains or not motions:
        return processing
    search = _Search(robot, motions)
    for axis in range(robot.n_joints):
        if axis not in found.still:
            distances[axis] = search.improve(axis, processing.speed[axis])
    return replace(processing, presliding=distances)


class _Search:
    """Inner products of all axes, of which the direction's depend on the distance."""

    def __init__(self, robot: Robot, motions: list[Motion]) -> None:
        n = robot.n_joints
        self._motions, self._shared = motions, shared_names(robot)
        self._rows = [[_columns(robot, motion, axis) for motion in motions] for axis in range(n)]
        self._parts = [blocks(motion) for motion in motions]
        self._products = np.stack([self._with(axis, 0.0) for axis in range(n)], axis=1)
        # friction turning round at once
        self._weights = Regression.weighed(self._blocks).weights

    def improve(self, axis: int, speed: float) -> float:
        """Find the distance of one axis, those of others being what they are; keep it."""
        found = {0.0: (self._error(), self._products[:, axis].copy())}

        def best(tried: list[float]) -> float:
            for distance in tried:
                self._products[:, axis] = self._with(axis, distance)
                found[distance] = self._error(), self._products[:, axis].copy()
            return min((d for d in found if d), key=lambda d: float(found[d][0].sum()))

        nearest = best([speed * each for each in DISTANCES])
        best([nearest * each for each in FINER])
        order = sorted(found, key=lambda d: (d > 0.0, float(found[d][0].sum())))
        chosen = simplest({str(d): found[d][0] for d in order}, self._products.shape[1])
        self._products[:, axis] = found[float(chosen)][1]
        return float(chosen)

    def _with(self, axis: int, distance: float) -> Array:
        """Products of one axis in each block, its direction following over a distance."""
        shares = []
        for motion, rows, parts in zip(self._motions, self._rows[axis], self._parts, strict=True):
            z = motion.passed(motion.direction_after(axis, distance)[:, np.newaxis])
            whole = np.hstack([rows, z[: len(rows)]])
            shares += [whole[part].T @ whole[part] for part in parts]
        return np.array(shares)

    def _error(self) -> Array:
        """Squared errors on blocks that were held out."""
        system = self._blocks.normal(self._weights)
        heard = np.flatnonzero(np.einsum("bkk->k", system.N) > 0)
        return HeldOut(system, system).error(heard)

    @property
    def _blocks(self) -> Blocks:
        counts = np.ones(self._products.shape[:2])
        return Blocks(self._shared, FRICTION, self._products, counts)


def _columns(robot: Robot, motion: Motion, axis: int) -> Array:
    """Torque, base parameters, coupled motors and friction of the speed's size, filtered."""
    rows = regressor(robot, motion.q, motion.qd, motion.qdd, joints=[axis])[:, 0]
    u = motion.qd[:, axis] / motion.processing.speed[axis]
    friction = np.column_stack([np.ones(len(u)), u, np.cbrt(u)])
    rotor = rotor_torque(robot, motion, axis)[:, np.newaxis]
    columns = [rotor, rows, coupled_friction(robot, motion.qd, axis), friction]
    passed = motion.passed(np.hstack(columns))[: len(motion.tau)]
    y = motion.tau[: len(passed), axis, np.newaxis] - passed[:, :1]
    return np.hstack([y, passed[:, 1:]])


def blocks(motion: Motion) -> list[slice]:
    """Parts of the samples that are used, `BLOCKS` at most."""
    used = np.flatnonzero(motion.used)
    duration = len(used) * motion.period * motion.rates.coarse
    n = int(np.clip(duration * motion.processing.band / SHORTEST, 1, BLOCKS))
    return successive(int(used[0]), int(used[-1]) + 1, n)
