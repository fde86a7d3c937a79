"""Base parameters and friction curves of a single axis moving back and forth.

The paper's own measurement (section 6.3), applied to imported motions: trapezoids, sines or any
other strokes. Friction changes its sign with the velocity, rigid-body torque does not. At equal
positions, half the sum of the torques forth and back is

    s = A_s p + o + (f(v_f) - f(v_b)) / 2,     A_s = (A_forth + A_back) / 2,

free of friction if both strokes pass at equal speeds, and half the difference is

    d = A_d p + (f(v_f) + f(v_b)) / 2,         A_d = (A_forth - A_back) / 2,

the friction (`halves`). No friction law is assumed: f is any odd function of the velocity, each
pair of strokes has its own f, and f changes continuously from pair to pair. If the strokes are not
mirror images, speeds and accelerations differ at equal positions; the model columns of both sides,
and levels of friction, account for the difference.

Step 1 condenses the pairs to s and d over bins of position. Step 2 (`solution`) is one weighted
least-squares fit of all pairs with friction eliminated. Parameters not excited by such motions,
couplings above all, are found beforehand and excluded (`excitation`). With the parameters known, d
is the friction curve over speed (`description`).

The torque of axes at rest is not used: static friction carries an unknown part of the load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeGuard

from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.planning.measurement import RecordedMotion

NAME = "back and forth"
"""Name of the method."""


def goes_back_and_forth(motion: RecordedMotion) -> TypeGuard[FreeMotion]:
    """Return True if a recording is of a single axis moving back and forth."""
    return isinstance(motion, FreeMotion) and motion.alone is not None
