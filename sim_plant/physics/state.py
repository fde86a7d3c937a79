"""Columns of the arrays of the compiled loop: constants, state and profile of the axes.

One row per axis, one column per quantity: three arrays replace fifty arguments of compiled
functions, and the whole state of the plant can be copied or compared in one statement. `const` is
fixed when the plant is built, `state` changes over time, `profile` is the trapezoid under way. All
joint side, SI.
"""

from __future__ import annotations

from itertools import count

_c = count()
MOTOR_INERTIA = next(_c)
"""Rotor inertia times the gear ratio squared [kg m^2]."""
GEAR = next(_c)
"""Motor revolutions per joint revolution."""
VELOCITY_MAX, PER_VELOCITY_MAX = next(_c), next(_c)
"""Maximum velocity [rad/s] and its reciprocal, since divisions are slow."""
KP, KV, KI = next(_c), next(_c), next(_c)
"""Gains of position loop [1/s], velocity loop [N m s/rad] and its integral part [N m/rad]."""
F_COULOMB, F_DEGRESSIVE, F_VISCOUS = next(_c), next(_c), next(_c)
"""Friction at 15 K, without lubricant effect [N m, N m, N m s/rad]."""
F_LOAD = next(_c)
"""Friction per transmitted torque."""
ASYMMETRY = next(_c)
PER_BRISTLE = next(_c)
"""Reciprocal of the presliding distance [1/rad]."""
BRISTLE_DAMPING = next(_c)
"""Damping of the presliding bristles [N m s/rad]."""
BRAKE = next(_c)
"""Holding torque of the brake [N m]."""
HEAT_PER_POWER = next(_c)
"""Steady temperature rise per friction power [K/W]."""
HEAT_TIME = next(_c)
RIPPLE_SIN = tuple(next(_c) for _ in range(3))
RIPPLE_COS = tuple(next(_c) for _ in range(3))
"""Torque ripple of orders 1, 2 and 6 of the motor angle: sine and cosine amplitudes [N m]."""
OTHER_ORDER, OTHER_SIN, OTHER_COS = next(_c), next(_c), next(_c)
"""Torque ripple of a further order, 0 for none, and its amplitudes [N m]."""
DRIFT = next(_c)
"""1 if friction drifts, 0 if it is constant."""
COUNTS_PER_RAD, ZERO = next(_c), next(_c)
"""Encoder increments per joint angle, signed by the mounting of the motor, and offset at q = 0."""
TORQUE_PER_MILLE, CURRENT_PER_MILLE = next(_c), next(_c)
"""Joint torque of one per mille of rated torque and of rated current, signed [N m]."""
NOISE = next(_c)
"""Standard deviation of the current sensor, as joint torque [N m]."""
DRIFT_STRENGTH = next(_c)
"""Scale of the effects of temperature, lubricant and chance on friction."""
N_CONST = next(_c)

_c = count()
Q, QD, QDD = next(_c), next(_c), next(_c)
TORQUE = next(_c)
"""Torque of the motor at this instant [N m]."""
TORQUE_LIMIT = next(_c)
INTEGRAL = next(_c)
"""Integral part of the velocity loop [N m]."""
Z = next(_c)
"""Bristle deflection over the presliding distance, -1..1."""
LOAD = next(_c)
"""Torque transmitted by the gear [N m]."""
TEMPERATURE, LUBRICANT, WANDER = next(_c), next(_c), next(_c)
C_NOW, D_NOW, V_NOW = next(_c), next(_c), next(_c)
"""Coulomb, degressive and viscous coefficients with drift."""
FRICTION = next(_c)
"""Friction torque at this instant [N m]."""
ENABLED = next(_c)
WINDOW, WINDOW_TIME, OUTSIDE = next(_c), next(_c), next(_c)
"""Following error window [rad], its time limit, and the time outside so far [s]."""
EVENTS = next(_c)
PUSH = next(_c)
"""External torque on the joint [N m or N]."""
N_STATE = next(_c)

_c = count()
START, P0, V0 = next(_c), next(_c), next(_c)
"""Start of the profile: instant [s], position and velocity."""
SEGMENTS = next(_c)
"""First of four pairs of duration [s] and acceleration [rad/s^2]."""
N_SEGMENTS = 4
END = SEGMENTS + 2 * N_SEGMENTS
"""End of the profile [s]."""
TARGET = END + 1
DEMAND, DEMAND_V = TARGET + 1, TARGET + 2
WITHHELD = TARGET + 3
"""Share of the demand's velocity not fed forward by the position loop."""
VELOCITY_OFFSET, TORQUE_OFFSET = TARGET + 4, TARGET + 5
"""Feed-forward of the master, added to the commands of velocity [rad/s] and torque [N m]."""
N_PROFILE = TARGET + 6
