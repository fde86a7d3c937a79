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

from hil.friction.equation import limit_or_reached
from hil.least_squares.solving import orthonormal, projected_out, solved
from hil.model.dynamics import mass_matrix

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from hil.arrays import Array
    from hil.estimation.mistakes.evidence import Channel
    from hil.estimation.mistakes.reading import Reading


OWN = 1e-5
"""As `rank` of `orthonormal`: base parameters that a part by itself can show."""
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
        self._stated, first = stated, [stated.columns(channel) for channel in channels]
        self._rows = [rows for rows, _ in first]
        self._own = [_own_terms(channel) for channel in channels]
        found = [_pure_error(c, *columns) for c, columns in zip(channels, first, strict=True)]
        limits = stated.robot.torque_limit
        least = [FINEST * limit_or_reached(limits[c.axis], c.tau) for c in channels]
        self.pure_error = np.maximum(found, least)
        """Standard deviation by channel, shape (n_channels,) [N m]."""
        self._blocks = [self._block(k, stated) for k in range(len(channels))]

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
        same, channels = reading.moves_as(self._stated), self.channels
        blocks = [
            self._blocks[k]
            if same and reading.reads_as(self._stated, channel)
            else self._block(k, reading)
            for k, channel in enumerate(channels)
        ]
        p = _fitted(blocks)
        left = [block[:, 0] - block[:, 1:] @ p for block in blocks]
        degrees = [max(channel.degrees, 1) for channel in self.channels]
        misfit = [float(x @ x) / n for x, n in zip(left, degrees, strict=True)]
        return Explanation(np.concatenate(left), np.array(misfit), p)

    def driving(self, reading: Reading, p: Array) -> tuple[int, ...]:
        """Joints that friction would drive, as power that it takes is negative."""
        found = []
        for k, channel in enumerate(self.channels):
            joint = reading.joint(channel.axis)
            rows, motor = self._columns(k, reading)
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

    def _columns(self, k: int, reading: Reading) -> tuple[Array, Array]:
        """Columns of a reading; the regressor is computed anew where its motion is another one."""
        known = self._rows[k] if reading.moves_as(self._stated) else None
        return reading.columns(self.channels[k], known)

    def _block(self, k: int, reading: Reading) -> Array:
        """Torque and base parameters without friction and own terms, over the pure error."""
        channel = self.channels[k]
        rows, motor = self._columns(k, reading)
        columns = channel.without_friction(np.column_stack([channel.tau - motor, rows]))
        block: Array = projected_out(self._own[k], columns) / self.pure_error[k]
        return block


def _own_terms(channel: Channel) -> Array:
    """Basis of a channel's own terms: an offset and |v|, by which friction may differ by direction.

    They are those of the speeds as recorded, so that they are the same in all readings.
    """
    speed = np.abs(channel.qd[:, channel.axis])
    terms = channel.without_friction(np.column_stack([np.ones_like(speed), speed]))
    return orthonormal(terms)[0]


def _fitted(blocks: Sequence[Array]) -> Array:
    """Base parameters of all channels."""
    products = np.sum([block.T @ block for block in blocks], axis=0)
    return solved(products[1:, 1:], products[1:, 0])


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
