"""A campaign thinned out: few samples of every measurement, on which readings are tried quickly.

To try another reading of all recordings means another regressor at every sample. Some thousand
samples decide between readings, so positions, velocities, accelerations and torques are smoothed
first and thinned out; the regressor follows from what is left. That it is not quite the smoothed
regressor is small against any mistake that is looked for.

Friction is eliminated from every part of a measurement by itself, as in
`hil.estimation.condensed`: a part is what belongs together (`condensed.groups`), and of motions
that are no strokes some seconds, so that every campaign has parts that can contradict each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.condensed import groups
from hil.friction.equation import own_friction, speed_scale
from hil.least_squares.solving import orthonormal, projected_out
from hil.least_squares.thinned import smoothed_at
from hil.least_squares.window import APART
from hil.runs.recording import IDLE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.arrays import Array
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot
    from hil.planning.measurement import ParameterMotion

    Indices = NDArray[np.intp]

MOST = 6000
"""Samples of all channels together, about."""
FEWEST = 24
"""Samples of a part below which it is left out."""
MOST_PARTS = MOST // FEWEST
"""Parts, evenly in time: more of them would hold more samples than that."""
LONGEST = 3.0
"""Of a part of a motion that is no strokes [s]."""
_SAME = 1e-6
"""As `rank` of `orthonormal`: columns of friction that one speed cannot tell apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Samples of one channel that share their friction.

    Attributes
    ----------
    rows : slice
        Where they stand among those of the channel.
    time : float
        Middle of the part since the bus was entered [s].
    friction : ndarray, shape (n, r)
        Orthonormal basis of what friction can be.
    """

    rows: slice
    time: float
    friction: Array

    def without_friction(self, x: Array) -> Array:
        """Rows of the part with friction projected out."""
        return projected_out(self.friction, x[self.rows])


@dataclass(frozen=True, slots=True, eq=False)
class Channel:
    """What was recorded of one axis while it moved.

    Attributes
    ----------
    axis : int
        From 0, as recorded.
    q, qd, qdd : ndarray, shape (n, n_joints)
        Of all axes, smoothed [rad, rad/s, rad/s^2].
    tau : ndarray, shape (n,)
        Of this axis [N m].
    time : ndarray, shape (n,)
        [s].
    parts : tuple of Part
    """

    axis: int
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    time: Array
    parts: tuple[Part, ...]

    def without_friction(self, x: Array) -> Array:
        """All rows with friction projected out, part by part."""
        return np.concatenate([part.without_friction(x) for part in self.parts])

    @property
    def degrees(self) -> int:
        """Samples less what friction takes up."""
        taken: int = sum(part.friction.shape[1] for part in self.parts)
        return len(self.tau) - taken


def channels(
    robot: Robot, prepared: Sequence[tuple[ParameterMotion, Signals]]
) -> tuple[Channel, ...]:
    """Thin a campaign out; channels without enough samples are left out.

    Parameters
    ----------
    prepared : sequence of (ParameterMotion, Signals)
        As `hil.estimation.two_step_methods.prepare` makes them.
    """
    found = [
        (axis, s, index)
        for axis in range(robot.n_joints)
        for _, s in prepared
        for index in _parts(robot, s, axis)
        if len(index) >= FEWEST
    ]
    if len(found) > MOST_PARTS:
        taken = np.linspace(0, len(found) - 1, MOST_PARTS).round().astype(int)
        found = [found[k] for k in taken]
    every = max(1, sum(len(index) for *_, index in found) // MOST)
    given: dict[int, list[tuple[Signals, list[Indices]]]] = {}
    for axis, s, whole in found:
        own = given.setdefault(axis, [])
        if not own or own[-1][0] is not s:
            own.append((s, []))
        own[-1][1].append(whole[:: max(1, min(every, len(whole) // FEWEST))])
    return tuple(_channel(robot, axis, own) for axis, own in given.items())


def _parts(robot: Robot, s: Signals, axis: int) -> Iterator[Indices]:
    used = s.usable(robot, axis)
    apart = max(1, round(APART / s.period))
    for group in groups(s):
        index = np.flatnonzero(used & group)[::apart]
        if (s.stroke != IDLE).any():
            yield index
        elif index.size:
            first = int(index[0])
            number = (index - first) * s.period // LONGEST
            yield from (index[number == k] for k in np.unique(number))


def _channel(
    robot: Robot, axis: int, given: Sequence[tuple[Signals, Sequence[Indices]]]
) -> Channel:
    rows, parts, first = [], [], 0
    for s, indices in given:
        together = np.concatenate(indices)
        rows.append(_smoothed(s, axis, together))
        shapes = own_friction(s, s.qd[:, axis] / speed_scale(robot, s, axis))
        smooth = smoothed_at(together, shapes, s.period)
        ends = np.cumsum([len(index) for index in indices])
        for index, own in zip(indices, np.split(smooth, ends[:-1]), strict=True):
            basis, _ = orthonormal(own, _SAME)
            time = float(s.time[index].mean())
            parts.append(Part(slice(first, first + len(index)), time, basis))
            first += len(index)
    n, columns = robot.n_joints, np.concatenate(rows)
    q, qd, qdd = (columns[:, k * n : (k + 1) * n] for k in range(3))
    return Channel(axis, q, qd, qdd, columns[:, -2], columns[:, -1], tuple(parts))


def _smoothed(s: Signals, axis: int, index: Indices) -> Array:
    columns = np.column_stack([s.q, s.qd, s.qdd, s.tau[:, axis], s.time])
    return smoothed_at(index, columns, s.period)
