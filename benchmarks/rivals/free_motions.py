"""Solvers for free motions, with rows weighted by axis.

The friction model has Coulomb and viscous friction and an offset, for all speeds.

robust
    pieces of time with a larger misfit than most have less weight (Huber's weights, iterated);
total least squares
    equal errors in the columns and in the torque, columns scaled to unit length.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.free_motion.gathering import gather
from hil.estimation.free_motion.variants import Variant
from hil.estimation.import_methods import estimate_from

from .solution import total_least_squares

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.least_squares.normal_equations import Normal
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recording

    Array = NDArray[np.float64]

HUBER = 1.345
"""Multiple of the usual misfit above which a piece has less weight: 95 % efficiency for normal
misfits (Huber 1981).
"""
ROUNDS = 30
"""Maximum number of rounds with Huber's weights."""


def fit_free_motions(
    robot: Robot, recorded: Iterable[tuple[RecordedMotion, Recording]], name: str
) -> Estimate:
    """Identify base parameters and friction by one of `SOLVERS`.

    Raises
    ------
    NotEnoughData
        No free motions, or too short ones.
    NotIdentifiable
        Base parameters that the motions do not excite, or that unknown gains leave open.
    """
    return estimate_from(robot, name, SOLVERS[name], gather(robot, recorded, Variant()))


def robust(pieces: Normal) -> tuple[Normal, Array]:
    """Return the equations with Huber's weights of pieces, and their solution."""
    equations, x = pieces, pieces.solution()
    for _ in range(ROUNDS):
        before, misfit = x, np.sqrt(pieces.error(x))
        usual = max(float(np.median(misfit)), 1e-300)
        equations = pieces.weighted(np.minimum(1.0, HUBER * usual / np.maximum(misfit, 1e-300)))
        x = equations.solution()
        if np.allclose(before, x, rtol=1e-9, atol=0.0):
            break
    return equations, x


def total(pieces: Normal) -> tuple[Normal, Array]:
    """Return the equations with their solution by total least squares; 0 for unexcited unknowns."""
    N, v = pieces.information, pieces.vector
    heard = np.diag(N) > 0
    x = np.zeros(len(v))
    x[heard] = total_least_squares(N[np.ix_(heard, heard)], v[heard], float(pieces.square.sum()))
    return pieces, x


SOLVERS: dict[str, Callable[[Normal], tuple[Normal, Array]]] = {
    "total least squares": total,
    "robust": robust,
}
"""Solvers by the name of their method."""
