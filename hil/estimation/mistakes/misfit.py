"""How well a reading explains a campaign: one regression for all, against every part by itself.

Each part of a measurement, fitted by itself with base parameters of its own, shows what noise,
ripple and wandering friction leave: its *pure error*. One set of base parameters for all parts
leaves more; how much more, as variance, is the *misfit* of a reading, the classical test for lack
of fit (Draper and Smith, *Applied Regression Analysis*, 1998, chapter 2). It is near 1 where
recordings agree with the model and with each other, whatever the noise is.

Two things are impossible whatever the residual: friction that drives its axis, and motion of
negative kinetic energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from hil.least_squares.solving import orthonormal, projected_out, solved
from hil.least_squares.terms import limit_or_reached
from hil.model.dynamics import mass_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from hil.estimation.mistakes.evidence import Channel
    from hil.estimation.mistakes.reading import Reading

    Array = NDArray[np.float64]

OWN = 1e-5
"""As `rank` of `orthonormal`: base parameters that a part by itself can show."""
N_OWN = 2
"""Terms of a channel by itself: an offset and |v|, by which friction may differ by direction."""
FINEST = 1e-4
"""Share of the torque limit that no reading is finer than, and no model truer."""
CONFIGURATIONS = 60
"""At which the mass matrix is looked at."""


@dataclass(frozen=True, slots=True, eq=False)
class Explanation:
    """What a reading makes of the campaign.

    Attributes
    ----------
    residual : ndarray, shape (n_samples,)
        Of all channels one after the other, over the pure error of each.
    misfit : ndarray, shape (n_channels,)
        Mean square of that, by channel.
    p : ndarray, shape (n_base,)
    """

    residual: Array
    misfit: Array
    p: Array

    @property
    def chi_square(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)


class Campaign:
    """Channels with their pure errors, on which readings are tried."""

    def __init__(self, channels: Sequence[Channel], stated: Reading) -> None:
        self.channels = channels
        found = [_pure_error(channel, *stated.columns(channel)) for channel in channels]
        limits = stated.robot.torque_limit
        least = [FINEST * limit_or_reached(limits[c.axis], c.tau) for c in channels]
        self.pure_error = np.maximum(found, least)
        """Standard deviation by channel, shape (n_channels,) [N m]."""

    @cached_property
    def parts(self) -> tuple[slice, ...]:
        """Where each part stands among the residuals."""
        found, first = [], 0
        for channel in self.channels:
            found += [slice(first + p.rows.start, first + p.rows.stop) for p in channel.parts]
            first += len(channel.tau)
        return tuple(found)

    def residuals(self, explained: Explanation) -> Iterator[tuple[Channel, Array]]:
        """Of each channel what an explanation leaves, over its pure error."""
        first = 0
        for channel in self.channels:
            yield channel, explained.residual[first : first + len(channel.tau)]
            first += len(channel.tau)

    def beyond(self, reading: Reading) -> bool:
        """Whether an axis would have slipped out of its range, where its stops are."""
        slip, robot = reading.slip, reading.robot
        if slip is None:
            return False
        q = np.concatenate([reading.motion(c)[0][:, slip.axis] for c in self.channels])
        q_min, q_max = robot.q_min[slip.axis], robot.q_max[slip.axis]
        return bool(q.min() < q_min or q.max() > q_max)

    def explain(self, reading: Reading) -> Explanation:
        """Fit base parameters under a reading."""
        blocks = [self._block(k, reading) for k in range(len(self.channels))]
        p = _fitted(blocks)
        left = [_left(block, p) for block in blocks]
        degrees = [max(channel.degrees, 1) for channel in self.channels]
        misfit = [float(x @ x) / n for x, n in zip(left, degrees, strict=True)]
        return Explanation(np.concatenate(left), np.array(misfit), p)

    def driving(self, reading: Reading, p: Array) -> tuple[int, ...]:
        """Joints that friction would drive, as power that it takes is negative."""
        found = []
        for channel in self.channels:
            joint = reading.joint(channel.axis)
            rows, motor = reading.columns(channel)
            left = channel.tau - motor - rows @ p
            turned = reading.sign_q[joint] * reading.sign_tau[joint]
            direction = np.sign(channel.qd[:, channel.axis])
            if np.ptp(direction) == 0:
                continue  # the mean, which is taken off, is as much friction as offset
            if turned * (left - left.mean()) @ direction < 0:
                found.append(joint)
        return tuple(found)

    def negative(self, reading: Reading, p: Array) -> bool:
        """Whether some motion would have a negative kinetic energy."""
        q = np.concatenate([reading.motion(channel)[0] for channel in self.channels])
        some = q[:: max(1, len(q) // CONFIGURATIONS)]
        rotors = np.diag(reading.robot.reflected_inertia / reading.scale**2)
        return bool(np.linalg.eigvalsh(mass_matrix(reading.robot, p, some) + rotors).min() < 0)

    def _block(self, k: int, reading: Reading) -> Array:
        """Torque, base parameters and the channel's own terms, over its pure error."""
        channel = self.channels[k]
        rows, motor = reading.columns(channel)
        speed = np.abs(channel.qd[:, channel.axis])
        columns = np.column_stack([channel.tau - motor, rows, np.ones_like(speed), speed])
        block: Array = channel.without_friction(columns) / self.pure_error[k]
        return block


def _fitted(blocks: Sequence[Array]) -> Array:
    """Base parameters of all channels, each of which has two terms of its own."""
    n = blocks[0].shape[1] - 1 - N_OWN
    N, v = np.zeros((n, n)), np.zeros(n)
    for block in blocks:
        Q, _ = orthonormal(block[:, 1 + n :])
        own = projected_out(Q, block[:, : 1 + n])
        N += own[:, 1:].T @ own[:, 1:]
        v += own[:, 1:].T @ own[:, 0]
    return solved(N, v)


def _left(block: Array, p: Array) -> Array:
    """What base parameters and a channel's own terms leave."""
    n = 1 + len(p)
    Q, _ = orthonormal(block[:, n:])
    return projected_out(Q, block[:, 0] - block[:, 1:n] @ p)


def _pure_error(channel: Channel, rows: Array, motor: Array) -> float:
    """Root mean square of what parts leave, each by itself."""
    square, degrees = 0.0, 0
    for part in channel.parts:
        columns = part.without_friction(np.column_stack([channel.tau - motor, rows]))
        Q, _ = orthonormal(columns[:, 1:], OWN)
        left = projected_out(Q, columns[:, 0])
        square += float(left @ left)
        degrees += len(left) - part.friction.shape[1] - Q.shape[1]
    return float(np.sqrt(square / max(degrees, 1)))
