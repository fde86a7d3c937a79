r"""Backlash: displacement of a link within a gear's gap, from the recorded motion of the motor.

The motor of axis k is recorded, its link is not. Let :math:`\delta` be the angle of the link beyond
that of the motor, at most half the gap :math:`b` in either direction. A gear in contact transmits
the torque :math:`T_k` of the rigid bodies, and it can only push: where :math:`T_k` changes sign,
contact is lost and the link moves freely,

.. math:: M_{kk} \ddot\delta = -T_k , \qquad |\delta| < b ,

until it meets the other side. It stays there, since the motor and the losses of the gear absorb the
impact (restitution of 0). So the gap is crossed in :math:`\sqrt{4 b M_{kk} / |T_k|}` after a step
of the torque, in :math:`(12 b M_{kk} / |\dot T_k|)^{1/3}` after a steady change of sign; meanwhile
the motor lacks the link's torque, and the impact brings back the momentum. One derivative gives
both effects: the torque of all axes changes as for a motion changed by :math:`\delta`,
:math:`\dot\delta` and :math:`\ddot\delta`. In contact :math:`\delta = -b \operatorname{sign} T_k`.

A soft gear adds :math:`-c T_k`. Fitted without the gap, a compliance takes part of the gap: least
squares adds :math:`b \overline{|T_k|} / \overline{T_k^2}` to :math:`c`. So the column of a fitted
compliance stays free (`columns`), and gap and compliance are estimated together.

The column per unit of :math:`b` depends on :math:`b`, so there is a column for each of `HALF_GAPS`.
It is valid for gaps from half to twice its own. The inertia of the rotor must be known separately
from that of the link, since the rotor does not cross the gap.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.least_squares.window import FIRST, SECOND, weights
from hil.model.dynamics import inverse_dynamics, mass_matrix

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.arrays import Array, Indices
    from hil.estimation.excluded.causes import Key
    from hil.estimation.signals import Signals
    from hil.model.robot import Robot

HALF_GAPS = (1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3)
"""Tested half gaps, each twice the previous one [rad or m]: 0.3 to 5.5 arc minutes."""
WITHIN = 2.0
"""Largest ratio of a size to the half gap of its column; beyond, another column is valid."""
PIECE, LEAD = 768, 256
"""Samples of a piece of a recording, and of the lead before it: pieces are simulated in parallel,
and the first change of sign makes a piece independent of its start."""
SPARSE = 8
"""Samples between two mass matrices, which change as slowly as the arm turns."""

FINER = 2.0 ** np.array([-0.5, -0.25, 0.0, 0.25, 0.5])
"""Ratios of further tested half gaps to the best of `HALF_GAPS`. The estimated backlash hardly
depends on the half gap of the column.
"""


def half_gap(robot: Robot, key: Key) -> float | None:
    """Return the half gap of a column, in the unit of the cause; None for another cause."""
    cause, *microns = key[0].split()
    if cause != "backlash" or not microns:
        return None
    return float(microns[0]) * (1e-6 * 180.0 / np.pi if robot.revolute[key[1]] else 1e-3)


def nearest(key: Key) -> Key:
    """Return the key with the half gap of `HALF_GAPS` closest to that of `key`."""
    cause, *microns = key[0].split()
    if cause != "backlash" or not microns:
        return key
    gap = min(HALF_GAPS, key=lambda each: abs(np.log(1e6 * each / float(microns[0]))))
    return f"backlash {1e6 * gap:.0f}", key[1]


class Driven(NamedTuple):
    """Torque and inertia of links in contact with the motors.

    Attributes
    ----------
    torque : ndarray, shape (n, n_joints)
        Torque, smoothed like all rows [N m].
    inertia : ndarray, shape (n_some, n_joints)
        Diagonal of the mass matrix without rotors, at one of `SPARSE` samples.
    some : ndarray of int, shape (n_some,)
        Indices of the samples of `inertia`.
    """

    torque: Array
    inertia: Array
    some: Indices

    @classmethod
    def compute(cls, robot: Robot, p: Array, signals: Sequence[Signals]) -> list[Driven]:
        """Compute torque and inertia of several recordings, from motion and base parameters."""
        torques = [s.smoothed(inverse_dynamics(robot, p, *s.link)) for s in signals]
        some = [np.append(np.arange(0, len(x) - 1, SPARSE), len(x) - 1) for x in torques]
        # a single call: the overhead of a call equals some hundred samples
        q = np.concatenate([s.q[at] for s, at in zip(signals, some, strict=True)])
        inertia = np.einsum("nii->ni", mass_matrix(robot, p, q))
        ends = np.cumsum([len(at) for at in some])[:-1]
        return list(map(cls, torques, np.split(inertia, ends), some))

    def acceleration(self, axis: int) -> Array:
        """Return the acceleration of an axis's link by a gear in contact, shape (n,)."""
        at = np.arange(len(self.torque))
        inertia = np.interp(at, self.some, self.inertia[:, axis])
        return np.asarray(self.torque[:, axis] / inertia)


def displacements(
    signals: Sequence[Signals],
    driven: Sequence[Driven],
    axis: int,
    places: Sequence[Indices],
    half_gaps: Sequence[float],
) -> Array:
    """Simulate the link of an axis, and return the displacement from its motor.

    Parameters
    ----------
    signals : sequence of Signals
    driven : sequence of Driven
        Torque and inertia of the links, one per recording.
    places : sequence of ndarray of int
        Indices of the wanted samples, one array per recording.
    half_gaps : sequence of float
        Tested half gaps [rad or m].

    Returns
    -------
    ndarray, shape (n_half_gaps, 3, n)
        Displacement, speed and acceleration, smoothed, in the order of `places`.
    """
    # sample indices of pieces with leads, shape (n_pieces, LEAD + PIECE)
    window = np.arange(-LEAD, PIECE)
    lengths = [len(s.time) for s in signals]
    pieces = [np.clip(np.arange(0, n, PIECE)[:, None] + window, 0, n - 1) for n in lengths]
    rate = np.concatenate([d.acceleration(axis)[at] for d, at in zip(driven, pieces, strict=True)])
    period = np.repeat([s.period for s in signals], [len(at) for at in pieces])
    turns = (rate.min(axis=1) <= 0.0) & (rate.max(axis=1) >= 0.0)
    # a link pushed in one direction only stays on its side: two more pieces stand for all others
    pushed = np.column_stack([-rate[turns].T, np.tile([-1.0, 1.0], (len(window), 1))])
    states = _crossed(pushed, np.append(period[turns], [1.0, 1.0]), np.array(half_gaps)[:, None])
    place = np.where(turns, np.cumsum(turns) - 1, turns.sum() + (rate[:, 0] < 0.0))
    found, first = [], 0
    for s, at, wanted in zip(signals, pieces, places, strict=True):
        taps = _taps(s.period)
        reach = len(taps) // 2
        near = np.clip(wanted[:, None] + np.arange(-reach, reach + 1), 0, len(s.time) - 1)
        whole = states[LEAD + near % PIECE, :, place[first + near // PIECE]]
        found.append((whole.swapaxes(1, 2) @ taps).transpose(1, 2, 0))
        first += len(at)
    return np.concatenate(found, axis=2)


def _crossed(acceleration: Array, period: Array, gap: Array) -> Array:
    """Simulate positions of links within gaps, shape (n, n_half_gaps, n_pieces).

    Parameters
    ----------
    acceleration : ndarray, shape (n, n_pieces)
        Acceleration of a free link, relative to its motor.
    period : ndarray, shape (n_pieces,)
    gap : ndarray, shape (n_half_gaps, 1)
    """
    # velocities are per sample, and increase in halves
    faster = np.multiply(period**2 / 2.0, acceleration, order="C")
    x, v = gap * np.sign(acceleration[0]), np.zeros((len(gap), len(period)))
    found, moved = np.empty((len(faster), *x.shape)), np.empty_like(x)
    free = np.empty(x.shape, bool)
    # in place: at these sizes, NumPy's temporary arrays and np.clip would take half of the time
    for n, change in enumerate(faster):
        np.add(v, change, out=v)
        np.add(x, v, out=moved)
        np.add(v, change, out=v)
        x = found[n]
        np.minimum(np.maximum(moved, -gap, out=x), gap, out=x)
        np.multiply(v, np.equal(x, moved, out=free), out=v)
    return found


@cache
def _taps(period: float) -> Array:
    """Return weights of the smoothed value, first and second derivative, shape (n, 3)."""
    window, beyond = weights(period), len(SECOND) // 2
    first, second = np.convolve(window, FIRST / period), np.convolve(window, SECOND / period**2)
    return np.column_stack([np.pad(window, beyond), first, second])
