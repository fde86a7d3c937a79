"""Control loops, power stage and sensors of a servo, compiled.

The control is a cascade as in industrial drives: a position loop gives a velocity command, a
velocity loop with integral part gives a torque, the torque saturates. The demand's velocity is fed
forward as configured, and so are the master's offsets of velocity and torque. The current loop
reaches its command within one control period, so the motor torque is a polygon in time and unique
at every instant: the current read at a SYNC belongs to that SYNC. The loops use an interpolated
encoder, finer than the increments reported by the drive.

Readings of position and torque are quantised in the units of the object dictionary, increments and
per mille; the current gets white noise before quantisation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_plant.compiled import inlined, ordered
from sim_plant.machine_protocol import AxisEvent
from sim_plant.physics import soft_gears as fl
from sim_plant.physics import state as st
from sim_plant.physics.trigonometry import sin_cos

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STANDSTILL_IN, STANDSTILL_OUT = 0.005, 0.01
"""Shares of the speed limit for standstill: entered below the first, left above the second."""
_DONE, _STANDSTILL = int(AxisEvent.DONE), int(AxisEvent.STANDSTILL)
_SATURATED, _FOLLOWING = int(AxisEvent.SATURATED), int(AxisEvent.FOLLOWING_ERROR)


@inlined
def command(const: Array, state: Array, profile: Array, i: int, h: float) -> float:
    """Return the torque command of the loops of an axis [N m], and advance the integral part."""
    if state[i, st.ENABLED] == 0.0:
        state[i, st.INTEGRAL] = 0.0
        return 0.0
    lead = (1.0 - profile[i, st.WITHHELD]) * profile[i, st.DEMAND_V] + profile[
        i, st.VELOCITY_OFFSET
    ]
    v = lead + const[i, st.KP] * (profile[i, st.DEMAND] - state[i, st.Q])
    error = v - state[i, st.QD]
    u = const[i, st.KV] * error + state[i, st.INTEGRAL] + profile[i, st.TORQUE_OFFSET]
    limit = state[i, st.TORQUE_LIMIT]
    if abs(u) < limit or u * error < 0.0:
        state[i, st.INTEGRAL] += h * const[i, st.KI] * error
    return float(min(max(u, -limit), limit))


@inlined
def ripple(const: Array, i: int, q: float) -> float:
    """Return the torque ripple of a motor at joint angle `q` [N m]."""
    s1, c1 = sin_cos(const[i, st.GEAR] * q)
    s2, c2 = 2.0 * s1 * c1, c1 * c1 - s1 * s1
    s4, c4 = 2.0 * s2 * c2, c2 * c2 - s2 * s2
    s6, c6 = s4 * c2 + c4 * s2, c4 * c2 - s4 * s2
    other = 0.0
    if const[i, st.OTHER_ORDER] != 0.0:
        s, c = sin_cos(const[i, st.OTHER_ORDER] * const[i, st.GEAR] * q)
        other = const[i, st.OTHER_SIN] * s + const[i, st.OTHER_COS] * c
    return float(
        other
        + const[i, st.RIPPLE_SIN[0]] * s1
        + const[i, st.RIPPLE_COS[0]] * c1
        + const[i, st.RIPPLE_SIN[1]] * s2
        + const[i, st.RIPPLE_COS[1]] * c2
        + const[i, st.RIPPLE_SIN[2]] * s6
        + const[i, st.RIPPLE_COS[2]] * c6
    )


@inlined
def events(const: Array, state: Array, profile: Array, i: int, now: float, h: float) -> int:
    """Return the `AxisEvent` bits of an axis after a step."""
    # without branches, which would cost more than all the decisions
    speed = abs(state[i, st.QD]) * const[i, st.PER_VELOCITY_MAX]
    stood = int(state[i, st.EVENTS]) & _STANDSTILL
    error = abs(profile[i, st.DEMAND] - state[i, st.Q])
    outside = state[i, st.OUTSIDE] + h if error > state[i, st.WINDOW] else 0.0
    state[i, st.OUTSIDE] = outside
    bits = _DONE * (now >= profile[i, st.END])
    bits |= _STANDSTILL * (speed < (STANDSTILL_OUT if stood else STANDSTILL_IN))
    alarms = _SATURATED * (abs(state[i, st.TORQUE]) >= state[i, st.TORQUE_LIMIT])
    alarms |= _FOLLOWING * (outside > state[i, st.WINDOW_TIME])
    return int(bits | alarms * (state[i, st.ENABLED] != 0.0))


@ordered
def latch(
    const: Array,
    state: Array,
    profile: Array,
    normal: Array,
    image: NDArray[np.int64],
    flaws: Array | None = None,
) -> None:
    """Read encoder and current sensor of every axis.

    Parameters
    ----------
    const, state, profile : ndarray, shape (n, ...)
    normal : ndarray, shape (n,)
        Standard normal deviates for the sensors' noise.
    image : ndarray, shape (n, 7)
        Written, in the order of `sim_plant.machine_protocol.Reading`.
    flaws : ndarray, shape (n, ...), optional
        See `sim_plant.physics.soft_gears`.
    """
    for i in range(const.shape[0]):
        scale, zero = const[i, st.COUNTS_PER_RAD], const[i, st.ZERO]
        torque = state[i, st.TORQUE]
        if flaws is not None:
            torque = fl.read_torque(flaws, i)
        torque += const[i, st.NOISE] * normal[i]
        position = round(state[i, st.Q] * scale + zero)
        demand = round(profile[i, st.DEMAND] * scale + zero)
        image[i, 0] = position
        image[i, 1] = round(state[i, st.QD] * scale)
        image[i, 2] = min(max(round(torque / const[i, st.TORQUE_PER_MILLE]), -32768), 32767)
        image[i, 3] = min(max(round(torque / const[i, st.CURRENT_PER_MILLE]), -32768), 32767)
        image[i, 4] = demand
        image[i, 5] = demand - position
        image[i, 6] = int(state[i, st.EVENTS])
