"""Control loops, power stage and sensors of one servo, compiled.

A cascade as in industrial drives: a position loop gives a velocity command, a velocity loop with
integral part gives a torque, the torque saturates. The current loop reaches its command within one
control period, so the motor's torque is a polygon in time and has one value at every instant: what
the current sensor reads at a SYNC belongs to exactly that SYNC. The loops see the shaft's angle
finer than the increments that the drive reports, as drives with interpolated encoders do.

`position` and `torque` readings are quantised as the object dictionary wants them: increments and
per mille, the current with white noise before quantisation.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numba import njit

from sim_plant import state as st
from sim_plant.axis import AxisEvent

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STANDSTILL_IN, STANDSTILL_OUT = 0.005, 0.01
"""Share of the speed limit below which an axis stands, and above which it moves again."""
_DONE, _STANDSTILL = int(AxisEvent.DONE), int(AxisEvent.STANDSTILL)
_SATURATED, _FOLLOWING = int(AxisEvent.SATURATED), int(AxisEvent.FOLLOWING_ERROR)


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def command(const: Array, state: Array, profile: Array, i: int, h: float) -> float:
    """Torque that the loops of one axis ask for [N m]; the integral part is advanced."""
    if state[i, st.ENABLED] == 0.0:
        state[i, st.INTEGRAL] = 0.0
        return 0.0
    v = profile[i, st.DEMAND_V] + const[i, st.KP] * (profile[i, st.DEMAND] - state[i, st.Q])
    error = v - state[i, st.QD]
    u = const[i, st.KV] * error + state[i, st.INTEGRAL]
    limit = state[i, st.TORQUE_LIMIT]
    if abs(u) < limit or u * error < 0.0:
        state[i, st.INTEGRAL] += h * const[i, st.KI] * error
    return float(min(max(u, -limit), limit))


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def ripple(const: Array, i: int, q: float) -> float:
    """Torque ripple of one motor at joint angle `q` [N m]."""
    angle = const[i, st.GEAR] * q
    s1, c1 = math.sin(angle), math.cos(angle)
    s2, c2 = 2.0 * s1 * c1, c1 * c1 - s1 * s1
    s4, c4 = 2.0 * s2 * c2, c2 * c2 - s2 * s2
    s6, c6 = s4 * c2 + c4 * s2, c4 * c2 - s4 * s2
    return float(
        const[i, st.RIPPLE_SIN[0]] * s1
        + const[i, st.RIPPLE_COS[0]] * c1
        + const[i, st.RIPPLE_SIN[1]] * s2
        + const[i, st.RIPPLE_COS[1]] * c2
        + const[i, st.RIPPLE_SIN[2]] * s6
        + const[i, st.RIPPLE_COS[2]] * c6
    )


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def events(const: Array, state: Array, profile: Array, i: int, now: float, h: float) -> int:
    """`AxisEvent` bits of one axis after a step."""
    bits = 0
    if now >= profile[i, st.END]:
        bits |= _DONE
    was = int(state[i, st.EVENTS])
    speed = abs(state[i, st.QD]) / const[i, st.VELOCITY_MAX]
    if speed < STANDSTILL_IN or (was & _STANDSTILL and speed < STANDSTILL_OUT):
        bits |= _STANDSTILL
    if state[i, st.ENABLED] != 0.0:
        if abs(state[i, st.TORQUE]) >= state[i, st.TORQUE_LIMIT]:
            bits |= _SATURATED
        if abs(profile[i, st.DEMAND] - state[i, st.Q]) > state[i, st.WINDOW]:
            state[i, st.OUTSIDE] += h
            if state[i, st.OUTSIDE] > state[i, st.WINDOW_TIME]:
                bits |= _FOLLOWING
        else:
            state[i, st.OUTSIDE] = 0.0
    return bits


@njit(cache=True, error_model="numpy")
def latch(
    const: Array, state: Array, profile: Array, normal: Array, image: NDArray[np.int64]
) -> None:
    """Read encoder and current sensor of every axis.

    Parameters
    ----------
    const, state, profile : ndarray, shape (n, ...)
    normal : ndarray, shape (n,)
        Standard normal deviates for the sensors' noise.
    image : ndarray, shape (n, 7)
        Written, in the order of `sim_plant.axis.Reading`.
    """
    for i in range(const.shape[0]):
        scale, zero = const[i, st.COUNTS_PER_RAD], const[i, st.ZERO]
        torque = state[i, st.TORQUE] + const[i, st.NOISE] * normal[i]
        position = round(state[i, st.Q] * scale + zero)
        demand = round(profile[i, st.DEMAND] * scale + zero)
        image[i, 0] = position
        image[i, 1] = round(state[i, st.QD] * scale)
        image[i, 2] = min(max(round(torque / const[i, st.TORQUE_PER_MILLE]), -32768), 32767)
        image[i, 3] = min(max(round(torque / const[i, st.CURRENT_PER_MILLE]), -32768), 32767)
        image[i, 4] = demand
        image[i, 5] = demand - position
        image[i, 6] = int(state[i, st.EVENTS])
