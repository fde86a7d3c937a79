"""What uncertain gains do to the base parameters: an error that no recording shows by itself.

A torque constant, or the gain of a map, that is off by a share scales all torques of its axis by
it, and the solution, which is linear in them, follows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.scaling import recast
from hil.estimation.free_motion.system import summed
from hil.regression.layout import embedded
from hil.regression.least_squares import solved
from hil.regression.normal_equations import normal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.free_motion.accumulation import Products
    from hil.estimation.free_motion.choice import Choice
    from hil.estimation.free_motion.scaling import Scaling
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


def effect_of_gains(
    robot: Robot, recorded: Products, scaling: Scaling, choice: Choice, n_base: int
) -> Array:
    """Change of the base parameters by one standard deviation of each axis's gain.

    Parameters
    ----------
    recorded : Products
        By `hil.estimation.free_motion.accumulation.recorded_products`.

    Returns
    -------
    ndarray, shape (n_base, 2 n_joints)
        The second half, of rotor inertias, is zero: what is known of them is exact here.
    """
    found = np.zeros((n_base, 2 * robot.n_joints))
    uncertainty = robot.torque_constant_uncertainty
    if not uncertainty.any():
        return found
    # what a gain scales is all that was recorded, rotors included
    products = recast(
        recorded,
        scaling.signal(recorded),
        np.arange(1, recorded.n_shared),
        scaling.columns(recorded),
        scaling.gains,
    )
    pieces, kept = summed(products.pieces, choice.slowest), choice.kept(products.n_shared)
    whole = choice.equations(products)
    N = whole.only(kept).information
    for axis in np.flatnonzero(uncertainty):
        alone = np.where(np.arange(robot.n_joints) == axis, choice.weights, 0.0)
        v = normal(pieces, products.n_shared, alone).only(kept).vector
        change = embedded(solved(N, v), kept, whole.v.shape[1])
        found[:, axis] = uncertainty[axis] * change[:n_base]
    return found
