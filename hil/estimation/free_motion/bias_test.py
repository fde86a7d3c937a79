"""Test whether measurement errors of the motion bias least squares (Durbin, Wu, Hausman).

Noise of the positions is noise of the accelerations, and so of columns of the regressor: least
squares then underestimates inertias. With columns from one half of the samples and instruments from
the other half, errors that are independent from sample to sample cause no bias. Without such errors
both estimates agree, up to the scatter over blocks of time (Hausman, Econometrica 46 (1978)
1251-1271). Parameters are tested separately by Student's t over blocks, with a correction for the
number of parameters (Bonferroni), which needs no more blocks than the error of one parameter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.free_motion.accumulation import division, recorded_products
from hil.estimation.free_motion.motion import FINE
from hil.estimation.free_motion.result import FEW_BLOCKS, BiasTest
from hil.estimation.intervals import SIGNIFICANT
from hil.friction.terms import BENT, COLUMNS, LAWS
from hil.least_squares.solving import solved

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.motion import Motion
    from hil.estimation.free_motion.scaling import Scaling
    from hil.model.robot import Robot


def bias_test(
    robot: Robot, stretches: Sequence[Motion], scaling: Scaling, choice: Choice, first: Array
) -> BiasTest | None:
    """Test least squares on the survey's stretches; return None for too few blocks."""
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
    n, tiny, m = len(first), np.finfo(float).tiny, products.n_pieces
    plain = choice.regression(products.pieces[0])
    crossed = plain.transfer(products.instruments)
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
