"""A first estimate of base parameters and gains: friction needs to know the transmitted torque."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.accumulation import division, recorded_products
from hil.estimation.free_motion.choice import without_choice
from hil.estimation.free_motion.open_scale import open_gains
from hil.estimation.free_motion.unknown_gains import first_scaling
from hil.model.base_parameters import base_parameters

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.motion import Processing
    from hil.estimation.free_motion.survey import Survey
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


def first_estimate(
    robot: Robot, found: Survey, processing: Processing, *, open_scale: bool = False
) -> tuple[Array, tuple[int, ...]]:
    """Weighted least squares over the survey's stretches.

    Parameters
    ----------
    open_scale : bool
        Whether a scale that unknown gains leave open is let stand, one gain of it held at 1.

    Returns
    -------
    p : ndarray, shape (n_base,)
    unknown : tuple of int
        Axes, from 0, whose gain is found with the parameters.

    Raises
    ------
    NotIdentifiable
        Parameters that unknown gains leave open up to scale.
    """
    n_base = len(base_parameters(robot))
    divided = division(processing, found.stretches, found.duration)
    recorded = recorded_products(robot, found.stretches, processing, divided, np.zeros(n_base))
    unknown = found.unknown_gains
    while open_scale and (lost := open_gains(recorded, unknown)):
        unknown = tuple(axis for axis in unknown if axis != lost[0])
    products = first_scaling(robot, recorded, unknown).applied(recorded)
    return without_choice(products, weighted=True).solution(products)[:n_base], unknown
