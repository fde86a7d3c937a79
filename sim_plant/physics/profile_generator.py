"""Profile generator of the drive: trapezoidal velocity profiles.

A set-point becomes at most four segments of constant acceleration, planned once from the demand's
present position and velocity (which need not be at rest: a new set-point may come in the middle of
a move) and evaluated in closed form, so no rounding accumulates and the demand ends exactly at its
target.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim_plant.compiled import inlined, ordered
from sim_plant.physics import state as st

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


def trapezoid(
    p: float, v: float, target: float, velocity: float, acceleration: float, deceleration: float
) -> list[tuple[float, float]]:
    """Return the segments (duration, acceleration) that bring (p, v) to rest at `target`.

    An axis that cannot stop before its target overshoots and comes back.
    """
    segments: list[tuple[float, float]] = []
    overshoot = p + v * abs(v) / (2 * deceleration)
    s = math.copysign(1.0, target - overshoot)
    if v * s < 0:
        segments.append((abs(v) / deceleration, math.copysign(deceleration, -v)))
        p, v = overshoot, 0.0
    distance = abs(target - p)
    speed = abs(v)
    peak = math.sqrt(
        (2 * acceleration * deceleration * distance + deceleration * speed**2)
        / (acceleration + deceleration)
    )
    cruise = min(peak, velocity)
    rate = acceleration if cruise >= speed else -deceleration
    change = (cruise - speed) / rate
    braking = cruise / deceleration
    way = distance - (speed + cruise) / 2 * change - cruise / 2 * braking
    segments.append((change, s * rate))
    segments.append((max(way, 0.0) / cruise if cruise > 0 else 0.0, 0.0))
    segments.append((braking, -s * deceleration))
    return segments


@ordered
def follow(profile: Array, now: float, target: float, period: float) -> None:
    """Process the next set-point of a stream with the given period [s].

    Between regular set-points the demand is their quadratic B-spline: half a period late, velocity
    continuous, acceleration constant within a period. The demand passes the middle between two
    set-points with their mean velocity. After an irregular set-point, two segments of constant
    acceleration lead the demand to that middle. Without a further set-point the demand comes to
    rest at the last one, as after a repeated set-point.
    """
    last, p, v = profile[st.TARGET], profile[st.DEMAND], profile[st.DEMAND_V]
    half, speed = period / 2, (target - last) / period
    ahead = (last + target) / 2 - p
    both, weighted = (speed - v) / half, 2 * (ahead / half - 2 * v) / half
    first = (weighted - both) / 2
    profile[st.START], profile[st.P0], profile[st.V0] = now, p, v
    profile[st.SEGMENTS : st.END] = 0.0
    place = st.SEGMENTS
    for duration, acceleration in ((half, first), (half, both - first), (period, -speed / period)):
        profile[place], profile[place + 1] = duration, acceleration
        place += 2
    profile[st.END], profile[st.TARGET] = now + 2 * period, target


def load(
    profile: Array, now: float, segments: list[tuple[float, float]], target: float | None
) -> None:
    """Start `segments` at the present demand; without a target, rest wherever they end."""
    p, v = float(profile[st.DEMAND]), float(profile[st.DEMAND_V])
    profile[st.START], profile[st.P0], profile[st.V0] = now, p, v
    profile[st.SEGMENTS : st.END] = 0.0
    end = now
    for k, (duration, acceleration) in enumerate(segments):
        profile[st.SEGMENTS + 2 * k : st.SEGMENTS + 2 * k + 2] = duration, acceleration
        end += duration
        p += (v + acceleration * duration / 2) * duration
        v += acceleration * duration
    profile[st.END] = end
    profile[st.TARGET] = p if target is None else target


@inlined
def evaluate(profile: Array, i: int, now: float) -> None:
    """Write demand position and velocity of an axis at time `now`."""
    t = now - profile[i, st.START]
    p, v = profile[i, st.P0], profile[i, st.V0]
    for k in range(st.N_SEGMENTS):
        part = min(t, profile[i, st.SEGMENTS + 2 * k])
        a = profile[i, st.SEGMENTS + 2 * k + 1]
        p += (v + 0.5 * a * part) * part
        v += a * part
        t -= part
    ended = now >= profile[i, st.END]
    profile[i, st.DEMAND] = profile[i, st.TARGET] if ended else p
    profile[i, st.DEMAND_V] = 0.0 if ended else v
