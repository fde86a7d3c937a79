"""Gear friction with drift by temperature, lubricant and chance.

The characteristic is degressive: a Coulomb part with a Stribeck peak, a part saturating with speed
(an arc tangent) and a viscous part. Three slow states change it: the temperature rise of the gear,
heated by friction power; the settled share of the lubricant, growing at rest and stirred up again
by motion; and a random wander. The slow states produce both effects in Fig. 2 of Grotjahn, Daemi
and Heimann (2001). At reversal the direction is not a sign but the deflection of a bristle (LuGre),
so that a held axis stays still. Friction may also grow with the transmitted torque.

The numbers of the model are assumptions; none of the friction models (1)-(3) of that paper fits the
model exactly.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim_plant.compiled import compiled, inlined
from sim_plant.physics import state as st
from sim_plant.physics.trigonometry import arc_tangent

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

STEADY_TEMPERATURE = 25.0
"""Temperature rise at half speed, continuous [K]."""
REFERENCE_TEMPERATURE = 15.0
"""Temperature rise at which the coefficients are stated [K]."""
KAPPA = (0.006, 0.015, 0.022)
"""Decrease of the Coulomb, degressive and viscous part with temperature [1/K]."""
LUBRICANT_GAIN = (0.12, 0.25, 0.10)
SETTLING_TIME, STIRRING_TIME = 180.0, 45.0
WANDER_SIGMA, WANDER_TIME = 0.01, 60.0
STRIBECK_GAIN, STRIBECK_SPEED = 0.10, 0.004
DEGRESSIVE_SPEED = 0.08
LUBRICANT_SPEED_REST, LUBRICANT_SPEED_MOTION = 0.01, 0.25


@inlined
def level(const: Array, state: Array, i: int, v: float) -> float:
    """Return the magnitude of the friction torque of an axis at speed `v` >= 0 [N m]."""
    share = v * const[i, st.PER_VELOCITY_MAX]
    x = share * (1.0 / STRIBECK_SPEED)
    coulomb = state[i, st.C_NOW]
    if x < 6.0:
        coulomb *= 1.0 + STRIBECK_GAIN * math.exp(-x * x)
    saturated = (2.0 / math.pi) * arc_tangent(share * (1.0 / DEGRESSIVE_SPEED))
    return float(coulomb + state[i, st.D_NOW] * saturated + state[i, st.V_NOW] * v)


@inlined
def torque(const: Array, state: Array, i: int, v: float, h: float) -> float:
    """Return the friction torque of an axis moving at `v`, and advance the bristle by `h`.

    Parameters
    ----------
    const, state : ndarray, shape (n, ...)
        The bristle deflection in `state` is advanced.
    i : int
        Index of the axis.
    v : float
        Joint velocity [rad/s].
    h : float
        Step [s].

    Returns
    -------
    float
        Torque against the motion [N m].
    """
    speed = abs(v)
    magnitude = level(const, state, i, speed) + const[i, st.F_LOAD] * abs(state[i, st.LOAD])
    if state[i, st.ENABLED] == 0.0:
        magnitude += const[i, st.BRAKE]
    # backward Euler of dz/dt = (v - |v| z) / distance
    slip = (v - speed * state[i, st.Z]) / (1.0 + h * speed * const[i, st.PER_BRISTLE])
    z = state[i, st.Z] + h * slip * const[i, st.PER_BRISTLE]
    state[i, st.Z] = z
    asymmetric = 1.0 + math.copysign(1.0, z) * const[i, st.ASYMMETRY]
    return float(magnitude * asymmetric * z + const[i, st.BRISTLE_DAMPING] * slip)


@compiled
def drift(const: Array, state: Array, normal: Array, dt: float) -> None:
    """Advance the slow states of all axes by `dt` and refresh the coefficients.

    Parameters
    ----------
    const, state : ndarray, shape (n, N_CONST), (n, N_STATE)
    normal : ndarray, shape (n,)
        Standard normal deviates for the wander.
    dt : float
        Time step [s].
    """
    for i in range(const.shape[0]):
        if const[i, st.DRIFT] == 0.0:
            continue
        speed = abs(state[i, st.QD])
        x = speed * const[i, st.PER_VELOCITY_MAX]
        heat = const[i, st.HEAT_PER_POWER] * abs(state[i, st.FRICTION]) * speed
        state[i, st.TEMPERATURE] += dt * (heat - state[i, st.TEMPERATURE]) / const[i, st.HEAT_TIME]
        settled = state[i, st.LUBRICANT]
        settled += dt * (
            (1.0 - settled) / SETTLING_TIME * math.exp(-x / LUBRICANT_SPEED_REST)
            - settled * x / LUBRICANT_SPEED_MOTION / STIRRING_TIME
        )
        state[i, st.LUBRICANT] = min(max(settled, 0.0), 1.0)
        sigma = const[i, st.DRIFT_STRENGTH] * WANDER_SIGMA
        state[i, st.WANDER] += (
            -dt * state[i, st.WANDER] / WANDER_TIME
            + sigma * math.sqrt(2.0 * dt / WANDER_TIME) * normal[i]
        )
        refresh(const, state, i)


@compiled
def refresh(const: Array, state: Array, i: int) -> None:
    """Refresh the friction coefficients of an axis from its slow states."""
    strength = const[i, st.DRIFT_STRENGTH]
    warmer = strength * (state[i, st.TEMPERATURE] - REFERENCE_TEMPERATURE)
    settled = strength * state[i, st.LUBRICANT]
    common = 1.0 + state[i, st.WANDER]
    state[i, st.C_NOW] = (
        common * const[i, st.F_COULOMB] * math.exp(-KAPPA[0] * warmer)
        * (1.0 + LUBRICANT_GAIN[0] * settled)
    )  # fmt: skip
    state[i, st.D_NOW] = (
        common * const[i, st.F_DEGRESSIVE] * math.exp(-KAPPA[1] * warmer)
        * (1.0 + LUBRICANT_GAIN[1] * settled)
    )  # fmt: skip
    state[i, st.V_NOW] = (
        common * const[i, st.F_VISCOUS] * math.exp(-KAPPA[2] * warmer)
        * (1.0 + LUBRICANT_GAIN[2] * settled)
    )  # fmt: skip
