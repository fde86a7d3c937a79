"""What each recording shows by itself: half-sums over position, beside the model.

Of the half-sums of each bin, mean over the pairs, friction that does not cancel and what differs by
direction are taken off; what remains is the torque of the rigid bodies, gravity where the axis goes
at constant speed. Its standard error is that of the scatter between pairs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.back_and_forth.halves import COMMON, FIRST, MOTOR, TORQUE, unknown_places
from hil.estimation.back_and_forth.solution import friction_levels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.estimation.back_and_forth.halves import Halves
    from hil.estimation.back_and_forth.solution import Solution
    from hil.model.robot import Robot

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class HalfSums:
    """Torque of the rigid bodies over the positions of one axis, as one recording shows it.

    Attributes
    ----------
    id : str
    axis : int
        From 0.
    pairs : int
    q : ndarray, shape (n,)
        [rad or m].
    measured, standard_error, model : ndarray, shape (n,)
        [N m or N]; standard errors are NaN where one pair passed.
    """

    id: str
    axis: int
    pairs: int
    q: Array
    measured: Array
    standard_error: Array
    model: Array


def half_sums(
    robot: Robot, recordings: Sequence[Halves], solution: Solution
) -> tuple[HalfSums, ...]:
    """Half-sums of all recordings."""
    return tuple(_of(robot, each, solution) for each in recordings)


def _of(robot: Robot, halves: Halves, solution: Solution) -> HalfSums:
    places = unknown_places(robot, halves.axis)
    last = FIRST + len(places)
    rigid, common = slice(FIRST, last - COMMON), slice(last - COMMON, last)
    friction = halves.sums[:, last:] @ friction_levels(robot, halves, solution)
    differing = halves.sums[:, common] @ solution.x[places[-COMMON:]]
    measured = halves.sums[:, TORQUE] - halves.sums[:, MOTOR] - friction - differing
    model = halves.sums[:, rigid] @ solution.x[places[:-COMMON]]
    q, means, fitting = (_mean(x, halves) for x in (halves.q[:, halves.axis], measured, model))
    n = np.bincount(np.unique(halves.bin, return_inverse=True)[1]).astype(float)
    left = _mean((measured - model) ** 2, halves) - (means - fitting) ** 2
    error = np.sqrt(np.maximum(left, 0.0) / np.where(n > 1, n - 1, np.nan))
    return HalfSums(halves.id, halves.axis, halves.n_pairs, q, means, error, fitting)


def _mean(x: Array, halves: Halves) -> Array:
    """Mean over the pairs, by bin."""
    number = np.unique(halves.bin, return_inverse=True)[1]
    return np.asarray(np.bincount(number, x) / np.bincount(number))
