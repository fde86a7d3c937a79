"""Torques that step in phase with the rows, under set-points held for several rows.

A policy or a slow controller gives new set-points every few rows. In between the servo pulls an
axis towards a constant position, so that the torque falls with the distance covered; with a new
set-point the torque steps up. If all steps occur at the same time within a row, recorded torques
deviate from the mean by up to half of a step in one row of each period. The deviation is
proportional to speed and acceleration, like friction and inertia.

With changes of torque dT and position dq from row to row, a torque without steps has the same slope
c of dT = c dq in all rows. Under held set-points the slope c_k depends on the row's number k within
a period of m rows. The steps are J = (c_k - c) dq, the greatest slope against the mean of the
others, and move the mean torque by up to J / (2 m): up, if rows hold the torque after the step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.imports.evidence import Suspicion

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array, Integers, Mask
    from hil.imports.evidence import Excerpt

SLOWEST = 0.1
"""Longest period of set-points [s], that of a policy at 10 Hz."""
RAISED = 0.02
"""Minimum error of a torque by the steps, as a share of the torque: usual of inertias in a good
identification."""
CHANCE = 30.0
"""Minimum variance ratio of slopes by phase; with 2 phases and 100 rows, and for more of either,
chance exceeds 30 once in three million."""
ALIKE = 0.9
"""Share of the greatest explained part for a shorter period: multiples of a period explain as
much."""


def stepping_torques(excerpts: Sequence[Excerpt], moves: Mask) -> Iterator[Suspicion]:
    """Yield a suspicion of torques that step in phase with the rows.

    Parameters
    ----------
    moves : ndarray of bool, shape (n_joints,)
        Joints that move by more than noise.
    """
    joints, period = np.flatnonzero(moves), excerpts[0].period
    longest = int(SLOWEST / period)
    if not len(joints) or longest < 2:
        return
    dq = np.concatenate([np.diff(each.q[:, joints], axis=0) for each in excerpts])
    dt = np.concatenate([np.diff(each.tau[:, joints], axis=0) for each in excerpts])
    rows = np.concatenate([round(x.begin / period) + np.arange(len(x.q) - 1) for x in excerpts])
    size = np.concatenate([each.tau[:, joints] for each in excerpts]).std(axis=0)
    whole = _products(dq, dt, np.zeros_like(rows), 1)
    found = {m: _steps(dq, dt, rows % m, m, whole) for m in range(2, longest + 1)}
    explained = {m: float(np.median(gain)) for m, (gain, _) in found.items()}
    least = ALIKE * max(explained.values())
    m = next(m for m, gain in explained.items() if gain >= least)
    error = found[m][1] / np.maximum(size, np.finfo(float).tiny)
    if explained[m] < CHANCE or np.median(error) < RAISED:
        return
    worst = int(np.argmax(error))
    yield Suspicion(
        "still",
        ("joints", int(joints[worst]), "torque"),
        f"steps every {m} rows ({1.0 / (m * period):.3g} Hz), as torques of most joints do, in "
        f"phase with the rows, as under set-points held for {1e3 * m * period:.3g} ms: torques "
        f"are off the mean by up to {100 * error[worst]:.2g} %, which looks like early torques, "
        "and like greater inertias and viscous friction; record mean torques, or rows at many "
        "times the rate of the set-points, or move the joints without steps",
        certain=False,
    )


def _products(dq: Array, dt: Array, phase: Integers, m: int) -> Array:
    """Return sums of dq^2, dq dT and dT^2 by phase, shape (3, m, n_joints)."""
    sums = np.zeros((3, m, dq.shape[1]))
    for k, product in enumerate((dq * dq, dq * dt, dt * dt)):
        np.add.at(sums[k], phase, product)
    return sums


def _steps(dq: Array, dt: Array, phase: Integers, m: int, whole: Array) -> tuple[Array, Array]:
    """Return variance ratio of slopes by phase, and rise of the mean torque, by joint."""
    tiny = np.finfo(float).tiny
    squares, products, _ = _products(dq, dt, phase, m)
    total = whole[:, 0]
    by_phase = (products**2 / np.maximum(squares, tiny)).sum(axis=0)
    alike = total[1] ** 2 / np.maximum(total[0], tiny)
    left = np.maximum(total[2] - by_phase, tiny * np.maximum(total[2], 1.0))
    ratio = (by_phase - alike) / (m - 1) / (left / max(len(dq) - m, 1))
    slopes = products / np.maximum(squares, tiny)
    k, joints = slopes.argmax(axis=0), np.arange(dq.shape[1])
    first = squares[k, joints], products[k, joints]
    others = (total[1] - first[1]) / np.maximum(total[0] - first[0], tiny)
    step = (slopes[k, joints] - others) * np.sqrt(total[0] / len(dq))
    return ratio, step / (2 * m)
