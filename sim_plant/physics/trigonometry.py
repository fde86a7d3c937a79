"""Sine, cosine and arc tangent without calls or branches, for inlining.

As calls into the C library they would be a third of the cost of the physics. The approximations
are those of Moshier's Cephes library, good to a few units in the last place.
"""

from __future__ import annotations

import math

from sim_plant.compiled import compiled, ordered

_PARTS = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""Sum of pi/2; the first two terms have few bits, so that their multiples are exact."""
_S = (
    -1.66666666666666307295e-1, 8.33333333332211858878e-3, -1.98412698295895385996e-4,
    2.75573136213857245213e-6, -2.50507477628578072866e-8, 1.58962301576546568060e-10,
)  # fmt: skip
_C = (
    4.16666666666665929218e-2, -1.38888888888730564116e-3, 2.48015872888517045348e-5,
    -2.75573141792967388112e-7, 2.08757008419747316778e-9, -1.13585365213876817300e-11,
)  # fmt: skip
_MIDDLE, _HIGH = 0.66, 2.41421356237309504880
_P = (
    -6.485021904942025371773e1, -1.228866684490136173410e2, -7.500855792314704667340e1,
    -1.615753718733365076637e1, -8.750608600031904122785e-1,
)  # fmt: skip
_Q = (
    1.945506571482613964425e2, 4.853903996359136964868e2, 4.328810604912902668951e2,
    1.650270098316988542046e2, 2.485846490142306297962e1,
)  # fmt: skip


@ordered
def sin_cos(angle: float) -> tuple[float, float]:
    """Return sine and cosine of `angle`, at most 1e5 rad, more than any motor turns.

    The nearest multiple of pi/2 is subtracted in three parts (Cody and Waite).
    """
    quarters = math.floor(angle * (2.0 / math.pi) + 0.5)
    r = ((angle - quarters * _PARTS[0]) - quarters * _PARTS[1]) - quarters * _PARTS[2]
    z = r * r
    s = _S[0] + z * (_S[1] + z * (_S[2] + z * (_S[3] + z * (_S[4] + z * _S[5]))))
    c = _C[0] + z * (_C[1] + z * (_C[2] + z * (_C[3] + z * (_C[4] + z * _C[5]))))
    sine, cosine = r + r * z * s, 1.0 - 0.5 * z + z * z * c
    quadrant = int(quarters) & 3
    if quadrant & 1:
        sine, cosine = cosine, -sine
    if quadrant & 2:
        sine, cosine = -sine, -cosine
    return sine, cosine


@compiled
def arc_tangent(x: float) -> float:
    """Return the arc tangent of `x` >= 0 [rad], reduced to `x`, (x - 1)/(x + 1) or -1/x."""
    middle, high = x > _MIDDLE, x > _HIGH
    numerator = -1.0 if high else (x - 1.0 if middle else x)
    denominator = x if high else (x + 1.0 if middle else 1.0)
    offset = math.pi / 2 if high else (math.pi / 4 if middle else 0.0)
    t = numerator / denominator
    z = t * t
    p = _P[0] + z * (_P[1] + z * (_P[2] + z * (_P[3] + z * _P[4])))
    q = _Q[0] + z * (_Q[1] + z * (_Q[2] + z * (_Q[3] + z * (_Q[4] + z))))
    return offset + (t + t * z * p / q)
