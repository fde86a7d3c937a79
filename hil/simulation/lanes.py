"""Many pieces of recordings, simulated at once with equal numbers of steps, and sensitivities.

A lane is one piece. The equations are those of `hil.simulation.arm`, solved in fixed steps h for
velocities: with M, bias and the other friction at the middle of the step, and impulses h l of the
friction elements,

    M (qd' - qd) = h (tau - c - g - f) - W' h l,   -F <= l <= F,

    l_e = F_e where w_e qd' > 0,   l_e = -F_e where w_e qd' < 0,   w_e qd' = 0 between.

This holds at the end of the step, so that elements stop and leave at steps alone: the error is of
order h^2 while all slide, and of order h in the instants of stops. Sensitivities of the positions
to the parameters follow the same equation, linearised along the simulated motion. Elements at rest
stay at rest; at a stop and at a break-away accelerations agree with both modes, so that
sensitivities do not jump there, save that an element at rest has none of velocity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.simulation.arm import FASTEST, MOST_STEPS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.arrays import Array, Mask
    from hil.simulation.arm import Arm, Drive

STEP = 2e-3
"""Longest step [s]."""
APART = 4e-3
"""Shortest time between instants that are compared [s]."""
MODES = 20
"""Maximum number of corrections of the modes in a step."""
RIDGE = 1e-12
"""Share of an element's own response added to it, where more elements rest than there are axes."""
DIFFERENCE = 1e-6
"""Difference of positions and velocities for derivatives [rad or m, and per s]."""
HELD = 1e6
"""Mass that holds an element at rest in sensitivities, over the largest of the arm."""


class Piece(NamedTuple):
    """Part of a recording: state at its first instant, instants and positions, and what drives."""

    q: Array
    qd: Array
    time: Array
    recorded: Array
    drive: Drive


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """Pieces side by side; L lanes, S intervals between compared instants, K steps in each.

    Shorter pieces end with steps of no length, which change nothing.

    Attributes
    ----------
    q, qd : ndarray, shape (L, n)
        Initial state.
    steps : ndarray, shape (S, L)
        Length of the steps of each interval [s].
    torque, wanted, speed : ndarray, shape (S * K, L, n)
        Mean torque of each step, and set-points in its middle.
    kp, kd : ndarray, shape (n,)
    recorded : ndarray, shape (S, L, n)
        Positions at the ends of the intervals; NaN beyond the end of a piece.
    """

    q: Array
    qd: Array
    steps: Array
    torque: Array
    wanted: Array
    speed: Array
    kp: Array
    kd: Array
    recorded: Array

    @classmethod
    def of(cls, pieces: Sequence[Piece], arm: Arm) -> Lanes:
        """Put pieces side by side."""
        period = float(np.median(np.diff(pieces[0].time)))
        every = max(1, round(APART / period))
        rate = max(arm.rate(each.drive) for each in pieces)
        longest = min(STEP, FASTEST / max(rate, 1e-9))
        n_steps = int(np.clip(np.ceil(every * period / longest - 1e-6), 1, MOST_STEPS))
        most = max((len(each.time) - 1) // every for each in pieces)
        steps, driven, recorded = [], [], []
        for each in pieces:
            ends, q = each.time[::every], each.recorded[::every]
            missing = most + 1 - len(ends)
            ends = np.pad(ends, (0, missing), mode="edge")
            q = np.pad(q, ((0, missing), (0, 0)), constant_values=np.nan)
            h = np.diff(ends) / n_steps
            at = np.append((ends[:-1, None] + h[:, None] * np.arange(n_steps)).ravel(), ends[-1])
            steps.append(h)
            recorded.append(q[1:])
            driven.append(_means(each.drive, at))
        torque, wanted, speed = (np.stack(each, axis=1) for each in zip(*driven, strict=True))
        drive = pieces[0].drive
        return cls(
            np.array([each.q for each in pieces]), np.array([each.qd for each in pieces]),
            np.stack(steps, axis=1), torque, wanted, speed, drive.kp, drive.kd,
            np.stack(recorded, axis=1),
        )  # fmt: skip


def _means(drive: Drive, at: Array) -> tuple[Array, Array, Array]:
    """Mean torques between instants, and set-points in their middle, shape (n - 1, n_joints)."""
    wide = np.maximum(np.diff(at), 1e-300)[:, None]

    def change(x: Array) -> Array:
        columns = [np.interp(at, drive.time, column) for column in x.T]
        return np.diff(np.column_stack(columns), axis=0) / wide

    gaps = np.diff(drive.time)[:, None]
    areas = np.cumsum(gaps * (drive.torque[1:] + drive.torque[:-1]) / 2, axis=0)
    impulse = np.vstack([np.zeros(drive.torque.shape[1]), areas])
    middle = (at[1:] + at[:-1]) / 2
    wanted = [np.interp(middle, drive.time, column) for column in drive.wanted.T]
    return change(impulse), np.column_stack(wanted), change(drive.wanted)


class Motion(NamedTuple):
    """Simulated states at the start and at the ends of the intervals, shape (S + 1, L, n).

    `rests` are the elements at rest at the end of each interval, shape (S, L, e), and `load` the
    torque that gears transmit there, shape (S, L, n) [N m or N].
    """

    q: Array
    qd: Array
    rests: Mask
    load: Array


def simulate(
    arm: Arm, lanes: Lanes, lost: Callable[[int, Array], bool] = lambda _, __: False
) -> Motion | None:
    """Simulate all lanes; None once `lost` holds, of an interval's number and the positions."""
    q, qd, n = lanes.q, lanes.qd, lanes.q.shape[-1]
    last = load = np.zeros_like(q)
    W, n_steps = arm.elements, len(lanes.torque) // len(lanes.steps)
    across = np.broadcast_to(W.T, (len(q), *W.T.shape))
    shared = np.broadcast_to(arm.coulomb, (len(q), len(arm.coulomb)))
    found, rests, loads = [(q, qd)], [], []
    for interval, steps in enumerate(lanes.steps):
        h = steps[:, None]
        for k in range(interval * n_steps, (interval + 1) * n_steps):
            at, speed = q + h / 2 * qd, qd + h / 2 * last
            mass, bias = arm.mass_and_bias(at, speed)
            turning = qd @ W.T
            side = np.sign(turning)
            forth = np.where(side[:, :n] < 0, -1.0, 1.0)
            other, level = arm.laws.at(at, speed, forth, load)
            tau = lanes.torque[k] + lanes.kp * (lanes.wanted[k] - at)
            tau = tau + lanes.kd * (lanes.speed[k] - speed)
            left = tau - bias - other - speed @ arm.viscous
            solved = np.linalg.solve(mass, np.concatenate([left[..., None], across], axis=-1))
            # accelerations that elements would have without friction, and to a rest
            free = solved[..., 0] @ W.T + turning / np.maximum(h, 1e-9)
            most = np.concatenate([level, shared], axis=-1)
            force = _friction(W @ solved[..., 1:], free, most, side)
            last = solved[..., 0] - (solved[..., 1:] @ force[..., None])[..., 0]
            held = np.abs(force) < most
            after = np.where(held[:, :n], 0.0, qd + h * last)
            if arm.laws.loaded:
                load = bias + ((mass - arm.rotors) @ last[..., None])[..., 0]
            q, qd = q + h / 2 * (qd + after), after
        found.append((q, qd))
        rests.append(held)
        loads.append(load)
        if lost(interval, q):
            return None
    at, speed = (np.array(each) for each in zip(*found, strict=True))
    return Motion(at, speed, np.array(rests), np.array(loads))


def _friction(G: Array, free: Array, most: Array, side: Array) -> Array:
    """Friction of the elements within its bounds, shape (L, e), by an active set.

    `free` are accelerations without friction, of which friction l takes G l.
    """
    mode, force = side, side * most
    for _ in range(MODES):
        held = mode == 0
        rows = np.flatnonzero(held.any(axis=1))
        if len(rows):
            force[rows] = _holding(G[rows], free[rows], force[rows], held[rows])
        left = free - (G @ force[..., None])[..., 0]
        broken = np.sign(force) * (np.abs(force) > most)
        changed = np.where(held, broken, np.where(mode * left < 0, 0.0, mode))
        if np.array_equal(changed, mode):
            break
        mode = changed
        force = np.where(mode == 0, 0.0, mode * most)
    return np.clip(force, -most, most)


def _holding(G: Array, free: Array, force: Array, held: Mask) -> Array:
    """Friction of which the held elements do not accelerate, shape (L, e)."""
    sliding = np.where(held, 0.0, force)
    wanted = np.where(held, free - (G @ sliding[..., None])[..., 0], force)
    both = held[:, :, None] & held[:, None, :]
    own = np.einsum("lee->le", G)
    added = np.where(held, RIDGE * own, 1.0)
    A = np.where(both, G, 0.0) + added[..., None] * np.eye(G.shape[-1])
    return np.asarray(np.linalg.solve(A, wanted[..., None])[..., 0])


def sensitivities(
    arm: Arm, lanes: Lanes, motion: Motion, columns: Callable[[Array, Array, Array, Array], Array]
) -> Array:
    """Derivatives of the positions by parameters, shape (S, L, n, n_parameters).

    Parameters
    ----------
    columns : callable
        Torque per parameter, shape (..., n, n_parameters), of positions, velocities,
        accelerations and load, shape (..., n) each.
    """
    h = (lanes.steps * (len(lanes.torque) // len(lanes.steps)))[..., None]
    q, qd = (motion.q[1:] + motion.q[:-1]) / 2, (motion.qd[1:] + motion.qd[:-1]) / 2
    qdd = np.diff(motion.qd, axis=0) / np.maximum(h, 1e-9)
    W = arm.elements
    mass, _ = arm.mass_and_bias(q, qd)
    stiffness, damping = _derivatives(arm, q, qd, qdd, motion.load)
    stiffness += np.diag(lanes.kp)
    damping += np.diag(lanes.kd) + arm.viscous
    weight = HELD * np.abs(mass).max()
    holding = np.einsum("...e,ei,ej->...ij", weight * motion.rests, W, W)
    h = h[..., None]
    A = mass + h * damping + h**2 / 2 * stiffness + holding
    inverse = np.linalg.inv(A)
    kept, pulled, driven = inverse @ mass, inverse @ (h * stiffness), inverse * h
    at = speed = np.zeros(())
    found = []
    for k in range(len(h)):
        torque = columns(q[k], qd[k], qdd[k], motion.load[k])
        if not k:
            at = speed = np.zeros_like(torque)
        after = kept[k] @ speed - pulled[k] @ at - driven[k] @ torque
        at, speed = at + h[k] / 2 * (speed + after), after
        found.append(at)
    return np.array(found)


def _derivatives(arm: Arm, q: Array, qd: Array, qdd: Array, load: Array) -> tuple[Array, Array]:
    """Derivatives of torque and friction by positions and velocities, (..., n, n) each."""
    n = q.shape[-1]
    units = DIFFERENCE * np.eye(n)

    def torque(q: Array, qd: Array) -> Array:
        return arm.torque(*np.broadcast_arrays(q, qd, qdd[..., None, :]))

    none = torque(q[..., None, :], qd[..., None, :])
    by_q = torque(q[..., None, :] + units, qd[..., None, :]) - none
    by_qd = torque(q[..., None, :], qd[..., None, :] + units) - none
    side = np.where(qd < 0, -1.0, 1.0)
    frictions = [
        other + side * level
        for other, level in (
            arm.laws.at(q, side * (np.abs(qd) + more), side, load) for more in (0.0, DIFFERENCE)
        )
    ]
    slope = side * (frictions[1] - frictions[0])
    stiffness, damping = (x.swapaxes(-1, -2) / DIFFERENCE for x in (by_q, by_qd))
    return stiffness, damping + slope[..., None] / DIFFERENCE * np.eye(n)
