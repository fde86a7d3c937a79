"""Rounded torques: steps so coarse that rounding hides the torque.

Rounding to a step d has a root mean square error of d / sqrt(12). Torques whose rounding alone
leaves the largest residual of a good model are doubted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.options import ACCURACY
from hil.imports.evidence import Suspicion
from hil.imports.held import EXCERPT
from hil.least_squares.standstill import increment

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Integers, Mask
    from hil.imports.samples import Samples

COARSE = ACCURACY * 12**0.5
"""Largest step of a torque, as a share of the root mean square."""


def rounded_torques(
    samples: Samples, parts: Sequence[Integers], moves: Mask
) -> Iterator[Suspicion]:
    """Yield a suspicion of torques in coarse steps, as recorded before any resampling.

    Parameters
    ----------
    parts : sequence of ndarray of int
        Rows of the stretches.
    moves : ndarray of bool, shape (n_joints,)
        Joints that move.
    """
    rows = max(parts, key=len)[:EXCERPT]
    torque = samples.read(rows)[:, samples.n_joints : 2 * samples.n_joints]
    size = np.maximum(np.abs(torque).max(axis=0), np.finfo(float).tiny)  # squares may overflow
    rms = size * np.sqrt(np.mean((torque / size) ** 2, axis=0))
    steps = np.array([increment(x) for x in torque.T])
    poor = np.flatnonzero(moves & (steps > COARSE * rms)).tolist()
    if poor:
        said = "; ".join(
            f"joint {k + 1} {steps[k]:.3g} (SI), {steps[k] / rms[k]:.0%} of the rms {rms[k]:.3g}"
            for k in poor
        )
        yield Suspicion(
            "still",
            ("joints", poor[0], "torque"),
            f"torques are recorded in coarse steps: {said}; at most {COARSE:.0%} allowed, as "
            f"rounding alone leaves {ACCURACY:.0%} of the torque there; record more digits, or "
            "motions with greater torques",
            certain=False,
        )
