"""Soft gears, backlash and lagging current sensors.

All are absent unless the plant file states them: without them `flaws` is None, and the compiler
omits this code.

A soft gear has the motor on one side and the link on the other. Encoder, friction and servo belong
to the motor; the arm moves with the link. A spring with a damper acts between them, without torque
within the backlash. Motor and link are then bodies of their own, so the motor's inertia leaves the
arm's mass matrix.

A lagging current reading is an earlier value, as from drives that average or queue readings.
"""

from __future__ import annotations

from itertools import count
from typing import TYPE_CHECKING

from sim_plant.compiled import inlined
from sim_plant.physics import state as st

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_c = count()
STIFFNESS, DAMPING = next(_c), next(_c)
"""Stiffness and damping of the gear [N m/rad], [N m s/rad]; 0 for a rigid gear."""
HALF_GAP = next(_c)
"""Half the backlash [rad]."""
LINK_Q, LINK_QD, LINK_QDD = next(_c), next(_c), next(_c)
TWIST = next(_c)
"""Torque of the spring [N m]."""
LAG = next(_c)
"""Lag of the current reading [steps]."""
HEAD = next(_c)
"""Place of the latest torque in the history."""
HISTORY = next(_c)
"""First column of the ring buffer with the torques of past steps [N m]."""


@inlined
def place(flaws: Array, motor: Array, link: Array, h: float) -> None:
    """Compute positions and velocities of the links in the middle of a step, shape (2, n)."""
    for i in range(flaws.shape[0]):
        if flaws[i, STIFFNESS] > 0.0:
            link[0, i] = flaws[i, LINK_Q] + 0.5 * h * flaws[i, LINK_QD]
            link[1, i] = flaws[i, LINK_QD] + 0.5 * h * flaws[i, LINK_QDD]
        else:
            link[0, i], link[1, i] = motor[0, i], motor[1, i]


@inlined
def couple(
    const: Array, state: Array, flaws: Array, motor: Array, link: Array, mass: Array, rhs: Array
) -> None:
    """Drive the links by the springs instead of the motors."""
    for i in range(flaws.shape[0]):
        if flaws[i, STIFFNESS] > 0.0:
            angle = motor[0, i] - link[0, i]
            gap = flaws[i, HALF_GAP]
            twist = 0.0
            if angle > gap or angle < -gap:
                twist = flaws[i, STIFFNESS] * (angle - gap if angle > gap else angle + gap)
                twist += flaws[i, DAMPING] * (motor[1, i] - link[1, i])
            flaws[i, TWIST] = twist
            rhs[i] += twist - state[i, st.LOAD]
            mass[i, i] -= const[i, st.MOTOR_INERTIA]


@inlined
def part(const: Array, state: Array, flaws: Array, link: Array, rhs: Array, h: float) -> None:
    """Advance the links; `rhs` holds their accelerations and receives those of the motors."""
    for i in range(flaws.shape[0]):
        if flaws[i, STIFFNESS] > 0.0:
            flaws[i, LINK_QDD] = rhs[i]
            flaws[i, LINK_QD] += h * rhs[i]
            flaws[i, LINK_Q] = link[0, i] + 0.5 * h * flaws[i, LINK_QD]
            rhs[i] = (state[i, st.LOAD] - flaws[i, TWIST]) / const[i, st.MOTOR_INERTIA]


@inlined
def remember(state: Array, flaws: Array) -> None:
    """Store the torques of this step."""
    size = flaws.shape[1] - HISTORY
    for i in range(flaws.shape[0]):
        head = (int(flaws[i, HEAD]) + 1) % size
        flaws[i, HEAD] = head
        flaws[i, HISTORY + head] = state[i, st.TORQUE]


@inlined
def read_torque(flaws: Array, i: int) -> float:
    """Return the torque shown by the current sensor of an axis [N m]."""
    size = flaws.shape[1] - HISTORY
    whole = int(flaws[i, LAG])
    share = flaws[i, LAG] - whole
    late = (int(flaws[i, HEAD]) - whole + size) % size
    later = (late - 1 + size) % size
    return float((1.0 - share) * flaws[i, HISTORY + late] + share * flaws[i, HISTORY + later])
