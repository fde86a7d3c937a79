"""Newton-Euler recursion on NumPy arrays, without a compiler.

Equations and their order are those of `hil.model.recursion`, so that regressors are equal to the
last bit; torques come from an inward pass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.model.newton_euler import ZERO, Exact, Joint, dot, motions, rigid_bodies, wrench

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Integers
    from hil.model.newton_euler import Scalar, Vector

_UNITS = [[Exact(value) for value in unit] for unit in np.eye(10).tolist()]
"""Bodies of a single standard parameter."""


def columns(
    state: Sequence[Sequence[Scalar]],
    frames: Array,
    parents: Integers,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    rows: Integers,
    out: Array,
) -> None:
    """Compute the torque on the joints `rows` per unit of standard parameters.

    Parameters
    ----------
    state : sequence
        For each joint cosine and sine of the angle about its axis, shift along it, velocity and
        acceleration: each an array of shape (n_samples,) or a number.
    frames, parents, gravity, kinds, links, rows, out
        As in `hil.model.recursion.columns`.
    """
    out[:] = 0.0
    joints, qd, qdd = _unpack(state, frames, parents)
    row_of = {link: row for row, link in enumerate(rows.tolist())}
    axes: dict[int, dict[int, tuple[Vector, Vector]]] = {-1: {}}
    for link, motion in enumerate(motions(joints, qd, qdd, gravity.tolist())):
        joint = joints[link]
        axes[link] = {row: joint.carry(axis) for row, axis in axes[joint.parent].items()}
        if link in row_of:
            axes[link][row_of[link]] = joint.axis
        for column in np.flatnonzero(links == link).tolist() if axes[link] else ():
            force, moment = wrench(_UNITS[kinds[column]], motion)
            for row, (turn, slide) in axes[link].items():
                power = dot(moment, turn) + dot(force, slide)
                if power is not ZERO:
                    out[:, row, column] = power


def torques(
    state: Sequence[Sequence[Scalar]],
    frames: Array,
    parents: Integers,
    gravity: Array,
    kinds: Integers,
    links: Integers,
    values: Array,
    out: Array,
) -> None:
    """Compute the torques for standard parameters of the given `values`, shape (n_columns,).

    Parameters are those of `columns`; `out` has the shape (n_samples, n_joints) and must be zero.
    """
    bodies: list[list[Scalar]] = [[ZERO] * 10 for _ in frames]
    for kind, link, value in zip(kinds, links, values.tolist(), strict=True):
        bodies[link][kind] = Exact(value)
    joints, qd, qdd = _unpack(state, frames, parents)
    for link, torque in enumerate(rigid_bodies(joints, bodies, qd, qdd, gravity.tolist())):
        out[:, link] = torque


def _unpack(
    state: Sequence[Sequence[Scalar]], frames: Array, parents: Integers
) -> tuple[list[Joint], list[Scalar], list[Scalar]]:
    """Return joints, velocities and accelerations, with numbers as `Exact`."""
    joints, rates = [], []
    for frame, parent, now in zip(frames.tolist(), parents.tolist(), state, strict=True):
        ca, sa, d, revolute = map(Exact, frame)
        c, s, shift, *rate = (Exact(x) if isinstance(x, float) else x for x in now)
        arm = d, -sa * shift, ca * shift
        joints.append(Joint(ca, sa, c, s, arm, bool(revolute), parent))
        rates.append(rate)
    qd, qdd = zip(*rates, strict=True)
    return joints, list(qd), list(qdd)
