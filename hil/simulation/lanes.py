"""Simulation of many pieces of recordings at once, with sensitivities to the parameters.

A lane is one piece. The equations are those of `hil.simulation.arm`, solved for velocities in fixed
steps h. With M, c, g and the undirected friction f at the middle of the step, and with the friction
l of the elements,

    M (qd' - qd) = h (tau - c - g - f - W' l),   -F <= l <= F,

    l_e = F_e where w_e qd' > 0,   l_e = -F_e where w_e qd' < 0,   w_e qd' = 0 otherwise.

Elements stop and break away only at the ends of steps: the error is of order h^2 during sliding,
and of order h at stops. Sensitivities of the positions follow the same equation, linearised along
the simulated motion, with one step per interval. Elements at rest stay at rest. Accelerations are
continuous at a break-away, so sensitivities do not jump there.
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
INTERVAL = 4e-3
"""Shortest interval between compared instants [s]."""
CORRECTIONS = 20
"""Maximum number of corrections of the modes in a step."""
RIDGE = 1e-12
"""Share of an element's own response added to it, for more elements at rest than axes."""
DIFFERENCE = 1e-6
"""Difference of positions and velocities for derivatives [rad or m, and per s]."""
HOLDING = 1e6
"""Mass that holds an element at rest in sensitivities, relative to the largest of the arm."""


class Piece(NamedTuple):
    """Part of a recording: initial state, instants, recorded positions, and the drive."""

    q: Array
    qd: Array
    time: Array
    recorded: Array
    drive: Drive


@dataclass(frozen=True, slots=True, eq=False)
class Lanes:
    """Pieces side by side: L lanes, S intervals between compared instants, K steps per interval.

    Shorter pieces end with steps of zero length.

    Attributes
    ----------
    q, qd : ndarray, shape (L, n)
        Initial state.
    steps : ndarray, shape (S, L)
        Length of the steps of each interval [s].
    torque : ndarray, shape (S, K, L, n)
        Mean torque of each step.
    recorded : ndarray, shape (S, L, n)
        Positions at the ends of the intervals; NaN beyond the end of a piece.
    """

    q: Array
    qd: Array
    steps: Array
    torque: Array
    recorded: Array

    @classmethod
    def create(cls, pieces: Sequence[Piece], arm: Arm) -> Lanes:
        """Put pieces side by side."""
        period = float(np.median(np.diff(pieces[0].time)))
        every = max(1, round(INTERVAL / period))
        rate = max(arm.rate(each.drive) for each in pieces)
        longest = min(STEP, FASTEST / max(rate, 1e-9))
        n_steps = int(np.clip(np.ceil(every * period / longest - 1e-6), 1, MOST_STEPS))
        n_intervals = max((len(each.time) - 1) // every for each in pieces)
        steps, torques, recorded = [], [], []
        for each in pieces:
            ends, q = each.time[::every], each.recorded[::every]
            missing = n_intervals + 1 - len(ends)
            ends = np.pad(ends, (0, missing), mode="edge")
            h = np.diff(ends) / n_steps
            instants = (ends[:-1, None] + h[:, None] * np.arange(n_steps)).ravel()
            steps.append(h)
            torques.append(_mean_torques(each.drive, np.append(instants, ends[-1])))
            recorded.append(np.pad(q, ((0, missing), (0, 0)), constant_values=np.nan)[1:])
        return cls(
            np.array([each.q for each in pieces]), np.array([each.qd for each in pieces]),
            np.stack(steps, axis=1),
            np.stack(torques, axis=1).reshape(n_intervals, n_steps, len(pieces), -1),
            np.stack(recorded, axis=1),
        )  # fmt: skip


def _mean_torques(drive: Drive, instants: Array) -> Array:
    """Return the mean torques between instants, shape (n - 1, n_joints)."""
    areas = np.diff(drive.time)[:, None] * (drive.torque[1:] + drive.torque[:-1]) / 2
    impulse = np.cumsum(np.vstack([0.0 * drive.torque[:1], areas]), axis=0)
    impulses = [np.interp(instants, drive.time, column) for column in impulse.T]
    return np.diff(impulses).T / np.maximum(np.diff(instants), 1e-300)[:, None]


class Motion(NamedTuple):
    """Simulated states at the start and at the ends of the intervals, shape (S + 1, L, n).

    `rests` is True for elements at rest at the end of each interval, shape (S, L, e), and `load` is
    the torque transmitted by the gears there, shape (S, L, n) [N m or N].
    """

    q: Array
    qd: Array
    rests: Mask
    load: Array


def simulate(
    arm: Arm, lanes: Lanes, lost: Callable[[int, Array], bool] = lambda _, __: False
) -> Motion:
    """Simulate all lanes, until `lost(interval, positions)` if ever."""
    q, qd, n = lanes.q, lanes.qd, lanes.q.shape[-1]
    qdd = load = np.zeros_like(q)
    W = arm.elements
    across = np.broadcast_to(W.T, (len(q), *W.T.shape))
    coupled = np.broadcast_to(arm.coulomb, (len(q), len(arm.coulomb)))
    found, rests, loads = [(q, qd)], [], []
    for interval, (steps, torques) in enumerate(zip(lanes.steps, lanes.torque, strict=True)):
        h = steps[:, None]
        for torque in torques:
            at, speed = q + h / 2 * qd, qd + h / 2 * qdd
            mass, bias = arm.mass_and_bias(at, speed)
            turning = qd @ W.T
            side = np.sign(turning)
            other, level = arm.laws.evaluate(at, speed, np.where(side[:, :n] < 0, -1.0, 1.0), load)
            left = torque - bias - other - speed @ arm.viscous
            solved = np.linalg.solve(mass, np.concatenate([left[..., None], across], axis=-1))
            # frictionless accelerations of the elements, plus those that undo a stop in this step
            free = solved[..., 0] @ W.T + turning / np.maximum(h, 1e-9)
            most = np.concatenate([level, coupled], axis=-1)
            force = _friction(W @ solved[..., 1:], free, most, side)
            qdd = solved[..., 0] - (solved[..., 1:] @ force[..., None])[..., 0]
            held = np.abs(force) < most
            after = np.where(held[:, :n], 0.0, qd + h * qdd)
            if arm.laws.loaded:
                load = bias + ((mass - arm.rotors) @ qdd[..., None])[..., 0]
            q, qd = q + h / 2 * (qd + after), after
        found.append((q, qd))
        rests.append(held)
        loads.append(load)
        if lost(interval, q):
            break
    positions, velocities = (np.array(each) for each in zip(*found, strict=True))
    return Motion(positions, velocities, np.array(rests), np.array(loads))


def _friction(G: Array, free: Array, most: Array, side: Array) -> Array:
    """Return the friction of the elements within its bounds, shape (L, e), by an active set.

    The elements have accelerations `free` without friction, and ``free - G l`` with friction l.
    """
    mode, force = side, side * most
    for _ in range(CORRECTIONS):
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
        force = mode * most
    return np.clip(force, -most, most)


def _holding(G: Array, free: Array, force: Array, held: Mask) -> Array:
    """Return the friction for which the held elements do not accelerate, shape (L, e)."""
    sliding = np.where(held, 0.0, force)
    wanted = np.where(held, free - (G @ sliding[..., None])[..., 0], force)
    both = held[:, :, None] & held[:, None, :]
    added = np.where(held, RIDGE * np.einsum("lee->le", G), 1.0)
    A = np.where(both, G, 0.0) + added[..., None] * np.eye(G.shape[-1])
    return np.asarray(np.linalg.solve(A, wanted[..., None])[..., 0])


def sensitivities(
    arm: Arm, lanes: Lanes, motion: Motion, columns: Callable[[Array, Array, Array, Array], Array]
) -> Array:
    """Return the derivatives of the positions by parameters, shape (S, L, n, n_parameters).

    Parameters
    ----------
    columns : callable
        Torque per parameter, shape (..., n, n_parameters), of positions, velocities,
        accelerations and load, shape (..., n) each.
    """
    h = (lanes.steps * lanes.torque.shape[1])[..., None]
    q, qd = (motion.q[1:] + motion.q[:-1]) / 2, (motion.qd[1:] + motion.qd[:-1]) / 2
    qdd = np.diff(motion.qd, axis=0) / np.maximum(h, 1e-9)
    mass, _ = arm.mass_and_bias(q, qd)
    stiffness, damping = _derivatives(arm, q, qd, qdd, motion.load)
    weight = HOLDING * np.abs(mass).max()
    holding = np.einsum("...e,ei,ej->...ij", weight * motion.rests, arm.elements, arm.elements)
    h = h[..., None]
    inverse = np.linalg.inv(mass + h * damping + h**2 / 2 * stiffness + holding)
    kept, pulled, driven = inverse @ mass, inverse @ (h * stiffness), inverse * h
    found: list[Array] = []
    for k in range(len(h)):
        torque = columns(q[k], qd[k], qdd[k], motion.load[k])
        if not found:
            at = speed = np.zeros_like(torque)
        after = kept[k] @ speed - pulled[k] @ at - driven[k] @ torque
        at, speed = at + h[k] / 2 * (speed + after), after
        found.append(at)
    return np.array(found)


def _derivatives(arm: Arm, q: Array, qd: Array, qdd: Array, load: Array) -> tuple[Array, Array]:
    """Return derivatives of torque and friction by positions and velocities, (..., n, n) each."""
    units = DIFFERENCE * np.eye(q.shape[-1])
    still = 0.0 * units

    def torque(dq: Array, dqd: Array) -> Array:
        moved = q[..., None, :] + dq, qd[..., None, :] + dqd, qdd[..., None, :]
        return arm.torque(*np.broadcast_arrays(*moved))

    def friction(more: float) -> Array:
        other, level = arm.laws.evaluate(q, qd + more * side, side, load)
        return side * other + level

    none, side = torque(still, still), np.where(qd < 0, -1.0, 1.0)
    stiffness, damping = (
        (each - none).swapaxes(-1, -2) / DIFFERENCE
        for each in (torque(units, still), torque(still, units))
    )
    slope = (friction(DIFFERENCE) - friction(0.0)) / DIFFERENCE
    return stiffness, damping + arm.viscous + slope[..., None] * np.eye(q.shape[-1])
