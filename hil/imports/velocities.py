"""Recorded velocity or the derivative of the position: whichever is less noisy and not late.

Noise is what third differences show, to which motion adds nothing at these rates. A recorded
velocity that lags, since a filter made it, would shift friction and inertia against the torque.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.imports.excerpt import Excerpt

    Array = NDArray[np.float64]

LAG = 0.5
"""Lag that is accepted, in periods."""
_THIRD = 20.0
"""Variance of the third difference of white noise of variance 1."""


@dataclass(frozen=True)
class VelocityChoice:
    """Which velocity of a joint is used, and why.

    Attributes
    ----------
    recorded : bool
    reason : str
        Half a sentence.
    """

    recorded: bool
    reason: str


def choose(excerpts: Sequence[Excerpt], joint: int) -> VelocityChoice:
    """Choose the velocity of a joint (from 0)."""
    if not np.isfinite(excerpts[0].qd[:, joint]).all():
        return VelocityChoice(recorded=False, reason="none was recorded")
    period = excerpts[0].period
    lag = _lag(excerpts, joint)
    if abs(lag) > LAG * period:
        return VelocityChoice(recorded=False, reason=f"the recorded one lags by {1e3 * lag:.1f} ms")
    noise = [_noise([e.qd[:, joint] for e in excerpts])]
    noise += [_noise([derivative(e.q[:, joint], period) for e in excerpts])]
    better = noise[0] < noise[1]
    compared = f"noise {noise[0]:.2g} recorded, {noise[1]:.2g} as the derivative"
    return VelocityChoice(recorded=better, reason=compared)


def derivative(q: Array, period: float) -> Array:
    """Velocity by central differences, shape of `q`."""
    return np.asarray(np.gradient(q, period, axis=0))


def _noise(parts: Sequence[Array]) -> float:
    thirds = np.concatenate([np.diff(part, n=3) for part in parts])
    return float(np.sqrt(np.mean(thirds**2) / _THIRD))


def _lag(excerpts: Sequence[Excerpt], joint: int) -> float:
    """How late the recorded velocity is [s], by its shape: v(t - lag) is v - lag a."""
    v, a, recorded = (
        np.concatenate([getattr(e.local(), name)[:, joint] for e in excerpts])
        for name in ("qd", "qdd", "recorded_qd")
    )
    regressors = np.stack([v, a], axis=1)
    if not np.any(v) or not np.any(a):
        return 0.0
    scale, shift = np.linalg.lstsq(regressors, recorded, rcond=None)[0]
    return float(-shift / scale) if abs(scale) > 0.1 else 0.0
