r"""Finite sizes of causes: tests with readings changed by a cause of a given size.

The column of a cause is the derivative of the torque at the readings, so it holds for small sizes.
A cause of a finite size :math:`s` changes the readings of the motion: all columns are then those of
the changed readings :math:`m_s`, while the torque remains as recorded. With the true motion
:math:`m`

.. math:: y = A(m_s) p + (\tau(m) - \tau(m_s)) + e .

For a torque :math:`\sin q` a joint offset leaves :math:`\sin s \cos(q - s) - (1 - \cos s)
\sin(q - s)`. The column :math:`\cos(q - s)` grows or vanishes with :math:`s`, shows the sine of
:math:`s`, and leaves the second term to other causes and to noise.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.excluded.alternatives import TORQUE, delayed, sized
from hil.estimation.excluded.battery import Battery
from hil.estimation.excluded.causes import CAUSES
from hil.estimation.excluded.columns import Columns, EvidenceRows, columns_of
from hil.model.dynamics import regressor
from hil.model.motors import motor_torque

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.estimation.excluded.columns import Column
    from hil.estimation.excluded.evidence import Evidence
    from hil.model.robot import Robot

FINITE = ("joint offset", "slip", "position scale", "gear ratio", "position delay", "torque delay")
"""Causes of an axis with a torque that is not linear in their size, apart from gains and backlash.
"""


def misread_battery(robot: Robot, p: Array, battery: Battery, k: int, size: float) -> Battery:
    """Return the tests with readings changed by the cause of column `k`, by a size in its unit.

    Causes of other axes are left out.
    """
    every, name = battery.columns, battery.columns.names[k]
    read = misread(robot, battery.evidence, name, size)
    rows = EvidenceRows(robot, p, read, battery.evidence)
    moved = dict(chain(columns_of(rows, name.axis), columns_of(rows, -1)))
    near = [
        (j, each)
        for j, each in enumerate(every.names)
        if each.axis in (name.axis, -1) or j in battery.given
    ]
    later = 1.0 if read.later is None else read.later
    # columns of backlash and of gear twist do not change
    values = [moved[each] * later if each in moved else every.values[:, j] for j, each in near]
    some = Columns(tuple(each for _, each in near), np.column_stack(values), every.free)
    given = [n for n, (j, _) in enumerate(near) if j in battery.given]
    return Battery(read, some, given, battery.unchanged)


def misread(robot: Robot, evidence: Evidence, name: Column, size: float) -> Evidence:
    """Return the evidence as read with a cause of a size, in the cause's unit."""
    axis, mine = name.axis, evidence.axis == name.axis
    motion, recorded = evidence.motion.copy(), evidence.recorded.copy()
    if name.cause == "torque delay":
        late, now = (delayed(evidence, axis, TORQUE, each)[1] for each in (size, 0.0))
        recorded += mine * (late - now)
    elif name.cause == "position delay":
        for k in range(TORQUE):
            motion[:, k, :, axis] = delayed(evidence, axis, k, size)
    else:  # `sized` corrects readings of a cause; the opposite size adds the cause
        opposite = -size / (1.0 + size / 100.0) if CAUSES[name.cause].unit == "%" else -size
        read = sized(robot, name.cause, axis, float(name.part or -np.inf))(opposite)
        motion = np.array([read.true_motion(each, evidence.time) for each in motion])
        recorded[mine] /= read.gain[axis]
    if evidence.later is not None:
        motion = np.where(evidence.later[:, np.newaxis], motion, evidence.motion)
        recorded = np.where(evidence.later, recorded, evidence.recorded)
    X, torque = evidence.X.copy(), evidence.torque + recorded - evidence.recorded
    moved = (motion[1] != evidence.motion[1]).any(axis=(0, 2))
    for channel in np.unique(evidence.axis).tolist():
        rows = moved & (evidence.axis == channel)
        for sign, each in ((1.0, motion[1]), (-1.0, evidence.motion[1])):
            q, qd, qdd = each[:, rows]
            X[rows] += sign * regressor(robot, q, qd, qdd, [channel])[:, 0]
            torque[rows] -= sign * motor_torque(robot, q, qd, qdd)[:, channel]
    return replace(evidence, motion=motion, recorded=recorded, torque=torque, X=X)
