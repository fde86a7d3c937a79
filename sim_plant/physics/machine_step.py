"""Integration of all axes over many steps, compiled.

Position drifts half a step, accelerations act in the middle, position drifts the other half
(leapfrog); velocity-dependent torques use the velocity extrapolated to the middle. So the scheme is
of second order and keeps energy over long times, at one evaluation of the dynamics a step. The
motor's torque over a step is the mean of its values at both ends, because the current loop slews
linearly between them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sim_plant.compiled import compiled
from sim_plant.physics import friction, profile_generator, rigid_body, servo
from sim_plant.physics import soft_gears as fl
from sim_plant.physics import state as st

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

SLOW_STEPS = 10
"""Steps between two updates of the slow friction states."""


@compiled
def run(
    steps: int,
    number: int,
    h: float,
    joints: tuple[int, ...],
    frames: Array,
    bodies: Array,
    gravity: Array,
    kinds: Array | None,
    const: Array,
    state: Array,
    profile: Array,
    normal: Array,
    flaws: Array | None = None,
) -> int:
    """Advance by at most `steps`, fewer if an axis's events change.

    Parameters
    ----------
    steps : int
    number : int
        Steps done since the machine was switched on.
    h : float
        Step [s].
    joints, frames, bodies, gravity, kinds
        See `sim_plant.physics.rigid_body`.
    const, state, profile : ndarray, shape (n, ...)
        See `sim_plant.physics.state`.
    normal : ndarray, shape (m, n)
        Standard normal deviates; every `SLOW_STEPS` steps the next row is used, in turn.

    Returns
    -------
    int
        Steps done; negative if events have changed in the last of them.
    """
    n = len(joints)
    middle, rhs = np.empty((2, n)), np.empty(n)
    mass, work = np.empty((n, n)), np.empty((n, rigid_body.WORK))
    link = middle
    if flaws is not None:
        link = np.empty((2, n))
    for done in range(1, steps + 1):
        for i in range(n):
            v = state[i, st.QD] + 0.5 * h * state[i, st.QDD]
            middle[0, i] = state[i, st.Q] + 0.5 * h * state[i, st.QD]
            middle[1, i] = v
        if flaws is not None:
            fl.place(flaws, middle, link, h)
        rigid_body.bias_and_mass(
            joints, frames, bodies, gravity, kinds, link[0], link[1], rhs, mass, work
        )
        for i in range(n):
            u = servo.command(const, state, profile, i, h)
            tau = 0.5 * (state[i, st.TORQUE] + u)
            state[i, st.TORQUE] = u
            state[i, st.FRICTION] = friction.torque(const, state, i, middle[1, i], h)
            if state[i, st.ENABLED] != 0.0:
                tau += servo.ripple(const, i, middle[0, i])
            state[i, st.LOAD] = tau - state[i, st.FRICTION]
            rhs[i] = state[i, st.LOAD] - rhs[i] + state[i, st.PUSH]
            mass[i, i] += const[i, st.MOTOR_INERTIA]
        if flaws is not None:
            fl.couple(const, state, flaws, middle, link, mass, rhs)
        rigid_body.solve_in_place(joints, mass, rhs)
        if flaws is not None:
            fl.part(const, state, flaws, link, rhs, h)
            fl.remember(state, flaws)
        number += 1
        now = number * h
        for i in range(n):
            profile_generator.evaluate(profile, i, now)
        changed = False
        for i in range(n):
            state[i, st.QDD] = rhs[i]
            state[i, st.LOAD] -= const[i, st.MOTOR_INERTIA] * rhs[i]
            v = state[i, st.QD] + h * rhs[i]
            state[i, st.Q] = middle[0, i] + 0.5 * h * v
            state[i, st.QD] = v
            bits = servo.events(const, state, profile, i, now, h)
            changed |= bits != state[i, st.EVENTS]
            state[i, st.EVENTS] = bits
        if number % SLOW_STEPS == 0:
            row = (number // SLOW_STEPS) % normal.shape[0]
            friction.drift(const, state, normal[row], SLOW_STEPS * h)
        if changed:
            return -done
    return steps


@compiled
def _copy(source: Array, target: Array) -> None:
    """Copy a matrix; a loop compiles in a tenth of the time of an assignment of slices."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def run_and_latch(
    steps: int,
    number: int,
    h: float,
    row: int,
    several: NDArray[np.int64],
    watch: NDArray[np.int64],
    readings: NDArray[np.int64],
    joints: tuple[int, ...],
    frames: Array,
    bodies: Array,
    gravity: Array,
    kinds: Array | None,
    const: Array,
    state: Array,
    profile: Array,
    normal: Array,
    noise: Array,
    image: NDArray[np.int64],
    flaws: Array | None = None,
) -> int:
    """Run as `run` and latch with a row of `noise`, unless the last step has an event.

    With `several`, run and latch repeatedly until an axis has news. Entering compiled code costs as
    much as a step, so it is done at most once a SYNC. Single and repeated latching are one
    function, since a function takes seconds to compile.

    Parameters
    ----------
    steps : int
        As in `run`.
    several : ndarray, shape (k,)
        Steps before each of several latches, in place of `steps`; none for a single one.
    watch : ndarray, shape (3, n)
        Known events, lowest and highest position of each axis: anything else is news.
    readings : ndarray, shape (k, n, 7)
        Written by several latches, see `physics.servo.latch`.

    Returns
    -------
    int
        As in `run`; with `several`, the number of latches without news. The machine is then in the
        state after these latches.
    """
    times = len(several)
    before, profile_before = np.empty(state.shape), np.empty(profile.shape)
    if flaws is not None:
        flaws_before = np.empty(flaws.shape)
    for k in range(max(times, 1)):
        if times:
            steps = several[k]
            _copy(state, before)
            _copy(profile, profile_before)
            if flaws is not None:
                _copy(flaws, flaws_before)
        done = run(
            steps, number, h, joints, frames, bodies, gravity, kinds, const, state, profile, normal,
            flaws,
        )  # fmt: skip
        if done == steps:
            servo.latch(const, state, profile, noise[row + k], image, flaws)
        if not times:
            return done
        news = done != steps
        for i in range(image.shape[0]):
            news |= image[i, 6] != watch[0, i]
            news |= image[i, 0] < watch[1, i] or image[i, 0] > watch[2, i]
        if news:
            # the caller repeats the time of this latch when processing the news
            _copy(before, state)
            _copy(profile_before, profile)
            if flaws is not None:
                _copy(flaws_before, flaws)
            return k
        for i in range(image.shape[0]):
            for j in range(image.shape[1]):
                readings[k, i, j] = image[i, j]
        number += steps
    return times
