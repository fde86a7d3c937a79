"""Where the error of a result comes from: its causes in torques, the largest first.

What a cause does to the base parameters (`hil.estimation.causes`) is carried to the torques of a
free motion, which makes all of them comparable. Squares of torques add up: to what the scatter of
the measurements leaves, that is noise and friction that wanders, come the causes that are not taken
into account, and those that are, with what ignoring them would do. A cause is named if its share of
that sum is worth it. Scatter itself is a cause where it is large and nothing else explains most of
it: then the motion hardly excites some parameters, or, if noise alone would not make them as
uncertain, measurements disagree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.causes import (
    ASYMMETRY,
    ENCODERS,
    LOAD_FRICTION,
    RIPPLE,
    SLOW_SYNC,
    SOFT_GEARS,
)
from hil.model.dynamics import regressor
from hil.results.validation_motion import free_motion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

WEAK_EXCITATION = "weak excitation"
DISAGREEMENT = "measurements that disagree"
LARGE = 0.005
"""Scatter, as share of the torques, from which on it is a cause."""
OF_NOISE = 0.25
"""Share of it, in torques, that white noise would make in motion that excites too little."""
NAMED = 0.1
"""Share of the sum from which on a cause is named."""
REMEDIES = {
    SOFT_GEARS: "nothing: links are placed where the gears let them be; a simulator or a"
    " feed-forward needs the compliances too",
    LOAD_FRICTION: "nothing: it is fitted; methods without it find other parameters",
    ASYMMETRY: "nothing: it is fitted; it shifts what the printed method finds",
    RIPPLE: "strokes at higher speeds, whose ripple the window takes away",
    ENCODERS: "encoders of more increments, or longer measurements",
    SLOW_SYNC: "a shorter SYNC period, in drives file and plan alike, or longer measurements",
    DISAGREEMENT: "a look at what differs between them: a hand that touches something, a machine"
    " that warms up, a motor that ripples",
    WEAK_EXCITATION: "measurements that move more joints through more of their ranges (hil plan,"
    " hil trajectory plan)",
}


@dataclass(frozen=True, slots=True)
class ErrorTerm:
    """One cause of error.

    Attributes
    ----------
    cause : str
    axes : tuple of int
        From 0; none where it concerns all.
    detail : str
        What was found.
    torque : float
        Error of the torques on a free motion, mean over joints of its root mean square over that of
        the torque; if the cause is accounted for, the error without that.
    share : float
        Of the sum of squares.
    accounted : bool
        Whether the estimate takes it into account.
    """

    cause: str
    axes: tuple[int, ...]
    detail: str
    torque: float
    share: float
    accounted: bool

    @property
    def remedy(self) -> str:
        """What to do about it."""
        return REMEDIES[self.cause]


def error_budget(estimate: Estimate, robot: Robot) -> tuple[ErrorTerm, ...]:
    """Name the causes that matter, the largest first; none where all is noise."""
    motion = free_motion(robot)
    A = regressor(robot, motion.q, motion.qd, motion.qdd)
    rms = np.sqrt(np.mean((A @ estimate.p) ** 2, axis=0))
    moved = rms > 0

    def size(square: Array) -> float:
        """Mean over joints; `square` is a change of p times itself, or a covariance."""
        variance = np.einsum("njk,kl,njl->j", A, square, A, optimize=True) / len(A)
        return float(np.mean(np.sqrt(np.maximum(variance, 0.0))[moved] / rms[moved]))

    scatter = size(estimate.covariance)
    parts = [size(cause.covariance) for cause in estimate.causes]
    rest = np.sqrt(max(0.0, scatter**2 - sum(part**2 for part in parts)))
    found = [
        (c.name, c.axes, c.detail, np.hypot(size(np.outer(c.change, c.change)), part), c.accounted)
        for c, part in zip(estimate.causes, parts, strict=True)
    ]
    if rest > LARGE and rest**2 > sum(part**2 for part in parts):
        noise = estimate.noise_covariance
        weak = noise is not None and size(noise) > OF_NOISE * rest
        name = WEAK_EXCITATION if weak else DISAGREEMENT
        found.append((name, (), f"torques are uncertain by {100 * rest:.2g} %", rest, False))
        rest = 0.0
    total = rest**2 + sum(torque**2 for *_, torque, _ in found)
    terms = [
        ErrorTerm(name, axes, detail, float(torque), float(torque**2 / total), accounted)
        for name, axes, detail, torque, accounted in found
    ]
    return tuple(sorted((t for t in terms if t.share > NAMED), key=lambda t: -t.share))
