"""What all excerpts of a recording show together: the samples that a map is judged by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.standstill import moving

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.imports.excerpt import Excerpt

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Evidence:
    """Motion and torques of all excerpts together: arrays (n, n_joints), SI, joint side.

    Of each joint besides, shape (n_joints,): the standard deviations that noise of positions gives
    `qd` and `qdd`, and whether it moves by more than this noise.
    """

    q: Array
    qd: Array
    qdd: Array
    tau: Array
    recorded_qd: Array
    noise_qd: Array
    noise_qdd: Array
    moves: NDArray[np.bool_]

    @classmethod
    def of(cls, excerpts: Sequence[Excerpt]) -> Evidence:
        """Join what the excerpts show."""
        parts = [excerpt.local() for excerpt in excerpts]
        return cls(
            q=np.concatenate([part.q for part in parts]),
            qd=np.concatenate([part.qd for part in parts]),
            qdd=np.concatenate([part.qdd for part in parts]),
            tau=np.concatenate([part.tau for part in parts]),
            recorded_qd=np.concatenate([part.recorded_qd for part in parts]),
            noise_qd=np.max([part.noise_qd for part in parts], axis=0),
            noise_qdd=np.max([part.noise_qdd for part in parts], axis=0),
            moves=moving([excerpt.extent for excerpt in excerpts]),
        )
