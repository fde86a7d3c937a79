"""Estimate torque noise and friction fluctuations from a campaign.

White noise shows in the residuals of thousands of samples. Friction fluctuations show in the
additional disagreement between measurements: the score of a measurement is the residual of its
normal equations at the joint solution,

    s = X'(y - X x),   E(s s') = a S_white + b S_wander,

with both matrices as for a prediction (`hil.planning.prediction.information`). Scores are weighted
by their effect on the base parameters, in the metric of the information, and summed over the
measurements of a kind. The sums are chi-squared, with degrees of freedom from the covariances; the
most likely a and b of each axis are taken. The prior is log-normal and wide: for
a around the level of the residuals, for b around the expectation before the campaign
(`hil.planning.prediction.noise`).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import optimize

from hil.estimation.condensed import ROTOR
from hil.estimation.simultaneous import SimultaneousFit
from hil.friction.equation import FEWEST, place
from hil.least_squares.solving import inverse_root, solved
from hil.least_squares.window import noise_gain
from hil.model.base_parameters import base_parameters
from hil.planning.prediction.information import add_up, shares
from hil.planning.prediction.noise import MINUTE, Noise, stated_noise

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ElementMeasurement
    from hil.planning.prediction.information import Information, Share

    Prepared = Sequence[tuple[ElementMeasurement, Signals]]


class Levels(NamedTuple):
    """Estimated noise, information for this noise, and base parameters (n_base,)."""

    noise: Noise
    known: Information
    p: Array


class _Piece(NamedTuple):
    """Measured normal equations of an axis in a measurement, and the expected information."""

    kind: str
    axis: int
    N: Array
    v: Array
    foreseen: Share


class _Sums(NamedTuple):
    """Sums over measurements of a kind and axis: squared scores and expected contributions.

    The expectation is a `white` + b `wander`; `freedom` is the number of degrees of freedom of
    `squares`, as a chi-squared variable.
    """

    squares: float
    white: float
    wander: float
    freedom: float


def noise_levels(robot: Robot, prepared: Prepared) -> Levels:
    """Estimate the noise of every axis from prepared measurements."""
    used = [
        (m, s)
        for m, s in prepared
        if any(s.usable(robot, axis).sum() >= FEWEST for axis in m.moved)
    ]
    joint = SimultaneousFit(robot, used)
    pieces = list(_pieces(robot, used, joint))
    expected = stated_noise(robot)
    white = 1.0 / joint.weight / noise_gain(used[0][1].period)
    found = []
    for axis, sums in enumerate(_all_sums(robot, pieces, joint)):
        level = white[axis] if sums else expected.white[axis]
        found.append(_likeliest(sums, float(level), float(expected.walk[axis])))
    a, b = np.array(found).T
    noise = Noise(np.sqrt(a), np.sqrt(MINUTE * b), "noise as in an earlier run")
    measured = (replace(each.foreseen, information=each.N) for each in pieces)
    return Levels(noise, add_up(robot, measured, noise), joint.solve())


def _pieces(robot: Robot, used: Prepared, joint: SimultaneousFit) -> Iterator[_Piece]:
    recorded = joint.recorded.drop(ROTOR)
    for (measurement, s), products, counts in zip(
        used, recorded.products, recorded.counts, strict=True
    ):
        for share in shares(robot, measurement, s.period):
            if counts[share.axis] > 0:
                own = products[share.axis]
                yield _Piece(measurement.kind, share.axis, own[1:, 1:], own[1:, 0], share)


def _all_sums(robot: Robot, pieces: Sequence[_Piece], joint: SimultaneousFit) -> list[list[_Sums]]:
    """Return the sums of every axis, by kind of measurement."""
    n_base = len(base_parameters(robot))
    x, matrix = joint.shares.solution(), joint.shares.information
    inverse = solved(matrix, np.eye(len(matrix)))
    metric = inverse_root(inverse[:n_base, :n_base]).T
    squares: dict[tuple[int, str], list[Array]] = defaultdict(list)
    for piece in pieces:
        at, weight = place(robot, piece.axis), joint.weight[piece.axis]
        effect = weight * metric @ inverse[:n_base, at]
        score = effect @ (piece.v - piece.N @ x[at])
        own = effect @ piece.N
        # the solution is shifted towards this measurement by its share of the information
        bent = weight * np.sum(own @ inverse[np.ix_(at, at)] * own) / np.sum(own * effect)
        white = (1.0 - bent) * effect @ piece.foreseen.white @ effect.T
        wander = (1.0 - bent) * effect @ piece.foreseen.wander @ effect.T
        each = [score @ score, np.trace(white), np.trace(wander), np.sum(white**2)]
        squares[piece.axis, piece.kind].append(np.array(each))
    found: list[list[_Sums]] = [[] for _ in range(robot.n_joints)]
    for (axis, _), parts in squares.items():
        square, white_sum, wander_sum, spread = np.sum(parts, axis=0).tolist()
        found[axis].append(_Sums(square, white_sum, wander_sum, white_sum**2 / spread))
    return found


def _likeliest(sums: Sequence[_Sums], white: float, walk: float) -> tuple[float, float]:
    """Return the likeliest variance of white noise and growth of the random walk."""

    def cost(logs: Array) -> float:
        factors = np.exp(logs)
        # standard deviations of the priors; the root of b is known within a factor of about 3
        total = (logs[0] / 0.3) ** 2 + (logs[1] / 2.0) ** 2
        for each in sums:
            mean = factors[0] * white * each.white + factors[1] * walk * each.wander
            total += each.freedom * (np.log(mean) + each.squares / mean)
        return float(total)

    best = optimize.minimize(cost, np.zeros(2), method="Nelder-Mead")
    a, b = np.exp(best.x).tolist()
    return white * a, walk * b
