"""Whether all torques of one axis changed by one factor: a drive or torque constant exchanged.

A factor 1 + d of an axis's torque changes the base parameters by d times what the estimator makes
of that (`torque_effect` of a model), and friction and offset of the axis by the share d. The factor
that fits the differences of two runs best, least squares weighted by errors and allowances, is
stated only if with it nothing of what was marked is left: a load, a screw or a bearing changes
some of these quantities, and not all by one share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.results.changes import FALSE_ALARM, adjusted
from hil.results.rounding import rounded, signed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.results.changes import Change
    from hil.results.model import Model

    Array = NDArray[np.float64]

FEWEST = 2
"""Marked quantities that one factor has to explain; a single one has causes of its own."""


class Rescaled(NamedTuple):
    """Another factor of an axis's torques in a run than in the one before it or the reference.

    Attributes
    ----------
    run, against : str
    axis : int
        From 1.
    share, half_width : float
        Change of all torques of the axis, and half of its interval of 95 %.
    explained : int
        Marked quantities that follow from it.
    """

    run: str
    against: str
    axis: int
    share: float
    half_width: float
    explained: int

    @property
    def sentence(self) -> str:
        """What changed, by how much, and what it comes from."""
        half = 100 * self.half_width
        return (
            f"{self.run}: torque constant or drive of axis {self.axis} exchanged or rescaled: all"
            f" torques of the axis changed by {signed(rounded(100 * self.share, half))} ±"
            f" {rounded(half, half)} % since {self.against}, which explains all"
            f" {self.explained} changes that are marked since then"
        )


def rescaled(model: Model, tests: Sequence[Change]) -> Rescaled | None:
    """Axis and factor that explain all that is marked of a run against another one.

    Parameters
    ----------
    model : Model
        Of the other run.
    tests : sequence of Change
        All that was tested between both.
    """
    marked = sum(each.marked for each in tests)
    if model.torque_effect is None or marked < FEWEST:
        return None
    found = (_by_axis(model, axis, tests, marked) for axis in range(model.robot.n_joints))
    best = [each for each in found if each is not None]
    return min(best, key=lambda each: each.half_width / abs(each.share), default=None)


def _by_axis(model: Model, axis: int, tests: Sequence[Change], marked: int) -> Rescaled | None:
    effect = np.array([_effect(model, axis, each) for each in tests])
    sizes = np.array([each.size for each in tests])
    weights = 1.0 / np.array([each.half_width**2 for each in tests])
    information = float(weights @ effect**2)
    if not information:
        return None
    share = float(weights @ (effect * sizes)) / information
    left = adjusted([
        each.less(float(share * part)) for each, part in zip(tests, effect, strict=True)
    ])  # fmt: skip
    moved = {each.quantity for each, part in zip(tests, effect, strict=True) if part}
    if any(each.marked for each in left) or not all(
        each.quantity in moved for each in tests if each.marked
    ):
        return None
    half = 1.0 / np.sqrt(information)
    if 2 * special.ndtr(-abs(share) * 1.96 / half) > FALSE_ALARM:
        return None
    first = tests[0]
    return Rescaled(first.run, first.against, axis + 1, share, float(half), marked)


def _effect(model: Model, axis: int, each: Change) -> float:
    """Change of a quantity per relative change of the axis's torque."""
    assert model.torque_effect is not None  # noqa: S101 - asked for before
    if each.quantity.axis is None:
        return float(model.torque_effect[model.names.index(each.quantity.name), axis])
    return each.before if each.quantity.axis == axis + 1 else 0.0
