"""Whether errors of the measured motion shift least squares: Durbin, Wu and Hausman's test.

Noise of the positions is noise of the accelerations, and so of columns of the regressor: least
squares then finds too small inertias. Instruments from one half of the samples, columns from the
other, are not shifted by errors that differ from sample to sample. Were there no such errors both
would find the same, up to what scatters over blocks of time (Hausman, Econometrica 46 (1978)
1251-1271). The statistic is Hotelling's T^2 of the difference over blocks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from hil.estimation.free_motion.accumulation import division, recorded_products
from hil.estimation.free_motion.result import BiasTest
from hil.estimation.free_motion.system import normal, summed
from hil.model.base_parameters import base_parameters
from hil.regression.least_squares import solved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.motion import Processing
    from hil.estimation.free_motion.scaling import Scaling
    from hil.estimation.free_motion.survey import Survey
    from hil.estimation.free_motion.system import Normal
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

BLOCKS_PER_PARAMETER = 1.5
"""Blocks below which the covariance of the difference means nothing."""
OVERSAMPLED = 8.0
"""Samples in a period of the cut-off frequency, so that halves of them show the motion."""


def bias_test(
    robot: Robot,
    found: Survey,
    processing: Processing,
    scaling: Scaling,
    choice: Choice,
    first: Array,
) -> BiasTest | None:
    """Test least squares on the survey's stretches; None where there are too few blocks."""
    period = found.stretches[0].period
    if processing.cut_off * period * OVERSAMPLED > 1.0:
        return None
    divided = division(
        processing, found.stretches, sum(s.period * s.n_samples for s in found.stretches)
    )
    recorded = recorded_products(
        robot, found.stretches, processing, divided, first, instruments=True
    )
    products = scaling.applied(recorded)
    n = len(base_parameters(robot))
    if products.instruments is None or len(products.pieces) < BLOCKS_PER_PARAMETER * n + 2:
        return None
    kept = choice.kept(products.n_shared)
    plain, crossed = (
        normal(each, products.n_shared, choice.weights).only(kept)
        for each in (summed(products.pieces), products.instruments)
    )
    difference = crossed.solution() - plain.solution()
    of_plain = _influence(plain)[:, :n]
    error = np.sqrt(np.maximum((of_plain**2).sum(axis=0), 1e-300))
    shift = float(np.max(np.abs(difference[:n]) / error))
    return _hotelling(difference[:n], _influence(crossed)[:, :n] - of_plain, shift)


def _influence(system: Normal) -> Array:
    """How much each block moves the solution, shape (n_blocks, n)."""
    return solved(system.N.sum(axis=0), system.scores(system.solution()).T).T


def _hotelling(difference: Array, influence: Array, shift: float) -> BiasTest:
    m = len(influence)
    size = np.sqrt(np.maximum((influence**2).sum(axis=0), 1e-300))
    spread = (influence / size).T @ (influence / size) * m / (m - 1)
    values, vectors = np.linalg.eigh(spread)
    kept = values > 1e-10 * values.max()
    k = int(kept.sum())
    square = float(np.sum((vectors[:, kept].T @ (difference / size)) ** 2 / values[kept]))
    statistic = square * (m - k) / (k * (m - 1))
    p_value = float(special.fdtrc(k, m - k, statistic))
    return BiasTest(statistic=statistic, p_value=p_value, shift=shift)
