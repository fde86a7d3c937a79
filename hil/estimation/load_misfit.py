"""Whether a rigid load explains what the axes gave: what their measurements leave, beside without.

Of every measurement of an axis remains its score (`hil.least_squares.uncertainty`) about the base
parameters, e. Had they to be found from this measurement alone, in as many directions r as it
determines, they would differ from those found by

    T = e'I^+ e,

with the information I of the measurement. Noise and friction that wanders leave some T in any run.
A load that gives way, slides or drags a cable along leaves more of it in the run with the load, as
does friction that the load changed. So the mean T / r of an axis with the load is compared with
that without: their ratio, were nothing else different, has about an F distribution with as many
degrees of freedom as there are measurements of the axis in each run. What T adds within a
measurement is alike in all of its directions, so r does not count them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.least_squares.solving import inverse_root
from hil.least_squares.terms import place

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    from hil.estimation.condensed import Condensed
    from hil.model.robot import Robot

    Array = NDArray[np.float64]
    Items = Sequence[Sequence[Condensed]]

_SHOWN = 1e-4
"""Share of the information's largest eigenvalue from which on a measurement shows a direction."""
_FEWEST = 2
"""Measurements of an axis in a run from which on it is tested."""


class AxisMisfit(NamedTuple):
    """What measurements of one axis with a load leave beside those without.

    Attributes
    ----------
    axis : int
        Index from 0.
    ratio : float
        Of the mean squares.
    p_value : float
        Chance of a ratio at least as great, were the load rigid and nothing else changed.
    """

    axis: int
    ratio: float
    p_value: float


def load_misfit(
    robot: Robot, n_base: int, bare: tuple[Items, Array], loaded: tuple[Items, Array]
) -> tuple[AxisMisfit, ...]:
    """Compare both runs, axis by axis; axes that the load's run hardly moves are left out.

    Parameters
    ----------
    bare, loaded : tuple of (items, ndarray of shape (n_unknowns,))
        Measurements, and what was found to hold in them.
    """
    without, with_load = (_left(robot, n_base, *each) for each in (bare, loaded))
    return tuple(
        _compared(axis, without[axis], with_load[axis])
        for axis in sorted(with_load)
        if min(len(without.get(axis, ())), len(with_load[axis])) >= _FEWEST
    )


def _left(robot: Robot, n_base: int, items: Items, x: Array) -> dict[int, list[tuple[float, int]]]:
    """T and r of every measurement, by axis."""
    found: dict[int, list[tuple[float, int]]] = {}
    for item in _every(items):
        score = (item.vector - item.information @ x[place(robot, item.axis)])[:n_base]
        t = inverse_root(item.information[:n_base, :n_base], _SHOWN).T @ score
        if len(t):
            found.setdefault(item.axis, []).append((float(t @ t), len(t)))
    return found


def _every(items: Items) -> Iterable[Condensed]:
    return (item for each in items for item in each)


def _compared(
    axis: int, without: list[tuple[float, int]], with_load: list[tuple[float, int]]
) -> AxisMisfit:
    (before, r), (after, s) = (np.sum(each, axis=0) for each in (without, with_load))
    ratio = float(after / s / (before / r)) if before > 0 else 1.0
    chance = special.fdtrc(len(with_load), len(without), ratio)
    return AxisMisfit(axis, ratio, float(chance))
