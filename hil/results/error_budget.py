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

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.causes import Cause, CauseName
from hil.results.error_term import ErrorTerm
from hil.results.prediction import FreeTorques

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot

    Array = NDArray[np.float64]

LARGE = 0.005
"""Scatter, as share of the torques, from which on it is a cause."""
OF_NOISE = 0.25
"""Share of it, in torques, that white noise would make in motion that excites too little."""
NAMED = 0.1
"""Share of the sum from which on a cause is named."""


def error_budget(estimate: Estimate, robot: Robot) -> tuple[ErrorTerm, ...]:
    """Name the causes that matter, the largest first.

    None where all is noise, and for methods that look for no causes.
    """
    if estimate.noise_covariance is None:
        return ()
    free = FreeTorques(robot)
    rms = free.rms(estimate.p)

    def relative(torques: Array) -> float:
        return float(np.mean(torques[rms > 0] / rms[rms > 0]))

    def scatter(covariance: Array) -> float:
        return relative(free.standard_error(covariance))

    causes = list(estimate.causes)
    explained = [scatter(cause.covariance) for cause in causes]
    torques = [
        float(np.hypot(relative(free.rms(cause.change)), own))
        for cause, own in zip(causes, explained, strict=True)
    ]
    square = sum(own**2 for own in explained)
    rest = float(np.sqrt(max(0.0, scatter(estimate.covariance) ** 2 - square)))
    if rest > LARGE and rest**2 > square:
        weak = scatter(estimate.noise_covariance) > OF_NOISE * rest
        name = CauseName.WEAK_EXCITATION if weak else CauseName.DISAGREEMENT
        none = np.zeros_like(estimate.p)
        detail = f"torques are uncertain by {100 * rest:.2g} %"
        causes.append(Cause(name, (), detail, none, estimate.covariance))
        torques.append(rest)
        rest = 0.0
    total = rest**2 + sum(torque**2 for torque in torques)
    terms = [
        ErrorTerm(
            cause=cause.name, axes=tuple(axis + 1 for axis in cause.axes), found=cause.detail,
            torque=torque, share=torque**2 / total, accounted=cause.accounted,
        )
        for cause, torque in zip(causes, torques, strict=True)
        if torque**2 > NAMED * total
    ]  # fmt: skip
    return tuple(sorted(terms, key=lambda term: -term.share))
