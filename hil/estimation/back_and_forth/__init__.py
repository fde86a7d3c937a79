"""Base parameters and friction curves from an axis that moves back and forth by itself.

The paper's own measurement (section 6.3), of motions that somebody else recorded: trapezoids, sines
or any other strokes. Friction changes its sign with the velocity and rigid bodies do not, so at the
same position half the sum of the torques forth and back is

    s = A_s p + o + (f(v_f) - f(v_b)) / 2,     A_s = (A_forth + A_back) / 2,

free of friction where both strokes pass at the same speed, and half the difference is

    d = A_d p + (f(v_f) + f(v_b)) / 2,         A_d = (A_forth - A_back) / 2,

the friction (`halves`). No law of it is assumed: f is any odd function of the velocity,
each pair of strokes has its own, and what it does between two pairs it does steadily. Where strokes
are no mirror images, their speeds and accelerations differ at the same position; that is what the
columns of the model on either side, and levels of friction, account for.

Step 1 condenses the pairs to s and d over bins of position. Step 2 (`solution`) is one weighted
least-squares fit of all of them, friction eliminated. What such motions cannot show, couplings
above all, is found beforehand and kept out (`excitation`). With the parameters known, d is the
curve of friction over the speed (`description`).

The torque of axes that stand still is not used: their static friction bears an unknown part of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeGuard

from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from hil.planning.measurement import RecordedMotion

NAME = "back and forth"
"""Of the method."""


def goes_back_and_forth(motion: RecordedMotion) -> TypeGuard[FreeMotion]:
    """Whether a recording is of one axis that moves back and forth by itself."""
    return isinstance(motion, FreeMotion) and motion.alone is not None
