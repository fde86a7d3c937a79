"""Test whether measurement errors of the motion bias least squares (Durbin, Wu, Hausman).

Noise of the positions is noise of the accelerations, and so of columns of the regressor: least
squares then underestimates inertias. With columns from one half of the samples and instruments from
the other half, errors that are independent from sample to sample cause no bias. Without such errors
both estimates agree, up to the scatter over blocks of time (Hausman, Econometrica 46 (1978)
1251-1271). Parameters are tested separately by Student's t over blocks, with a correction for the
number of parameters (Bonferroni), which needs no more blocks than the error of one parameter.

Where joints move one by one, some combinations of parameters hardly move the torque, and noise of
the positions is most of their columns. Then instruments are as weak as the columns, and the test
shows nothing. With W from one half, Z from the other, and all nuisances eliminated, Z'W is the
information of the motion, and W'W that of motion and noise: eigenvalues of Z'W for unit W'W are the
share of the motion. Below one half, noise determines the combination (`noise_directions`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.free_motion.accumulation import division, recorded_products
from hil.estimation.free_motion.motion import FINE
from hil.estimation.free_motion.result import FEW_BLOCKS, BiasTest
from hil.estimation.intervals import SIGNIFICANT
from hil.friction.terms import BENT, COLUMNS, LAWS
from hil.least_squares.solving import inverse_root, nuisance_elimination, solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.motion import Motion
    from hil.estimation.free_motion.scaling import Scaling
    from hil.least_squares.regression import Regression
    from hil.model.robot import Robot


class Halves(NamedTuple):
    """Regressions of the survey's stretches: least squares, and with instruments."""

    plain: Regression
    crossed: Regression


def halves(
    robot: Robot, stretches: Sequence[Motion], scaling: Scaling, choice: Choice, first: Array
) -> Halves | None:
    """Condense the halves of the samples; return None for too few blocks."""
    periods, processing = [each.rates.period for each in stretches], stretches[0].processing
    # half of the samples must resolve the motion
    if processing.cut_off * periods[0] * FINE > 1.0:
        return None
    samples = [each.recording.n_samples for each in stretches]
    usable = len(stretches), sum(each.duration for each in stretches)
    divided = division(processing, float(np.dot(periods, samples)), usable=usable)
    terms = tuple(t for t in COLUMNS if t == BENT or any(t in LAWS[law] for law in choice.laws))
    products = scaling.applied(
        recorded_products(
            robot,
            stretches,
            divided,
            first,
            # unknown gains are linearised about a torque of all terms
            COLUMNS if scaling.unknown else terms,
            instruments=True,
            soft=processing.soft,
        )
    )
    if products.instruments is None or products.n_pieces < FEW_BLOCKS:
        return None
    plain = choice.regression(products.pieces[0])
    return Halves(plain, plain.transfer(products.instruments))


def noise_directions(both: Halves, n: int) -> Array:
    """Return combinations of the first `n` unknowns that noise determines, shape (n, n_found)."""
    N, crossed = (each.normal.information for each in both)
    P = nuisance_elimination(N, n)
    B = inverse_root(P @ N[:, :n])
    share, V = np.linalg.eigh(B.T @ P @ (crossed + crossed.T) @ P.T @ B / 2.0)
    return np.asarray(B @ V[:, share < 0.5])


def bias_test(both: Halves, n: int) -> BiasTest:
    """Test the first `n` unknowns of least squares."""
    plain, crossed = both
    tiny, m = np.finfo(float).tiny, len(plain.blocks)
    difference = (crossed.solution - plain.solution)[:n]
    # change of the solution by every block, shape (n_blocks, n)
    of_plain, of_crossed = (
        solved(each.information, each.scores(each.solution()).T).T[:, :n]
        for each in (plain.normal, crossed.normal)
    )
    scatter = np.sqrt(np.maximum(((of_crossed - of_plain) ** 2).sum(axis=0) * m / (m - 1), tiny))
    t = np.abs(difference) / scatter
    p = np.minimum(1.0, 2.0 * n * special.stdtr(m - 1, -t))
    error = np.sqrt(np.maximum((of_plain**2).sum(axis=0), tiny))
    return BiasTest(
        statistic=float(t.max()),
        p_value=float(p.min()),
        shift=float(np.max(np.abs(difference) / error)),
        change=tuple(np.where(p < SIGNIFICANT, difference, 0.0).tolist()),
    )
