"""Whether all torques of one axis changed by one factor: a drive or torque constant exchanged.

A factor 1 + d of an axis's torque changes the base parameters by d times what the estimator makes
of that (`torque_effect` of a model), and friction and offset of the axis by the share d. The factor
that fits the differences of two runs best, least squares weighted by errors and allowances, is
stated only if with it nothing of what was marked is left, and if what is left without the quantity
that determines it most shows a factor too, of the same sign: a load, a screw or a bearing changes
some of these quantities, and not all by one share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.results.changes import adjusted
from hil.results.rounding import rounded, signed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from hil.results.changes import Change
    from hil.results.identified_robot import IdentifiedRobot

    Array = NDArray[np.float64]

SURE = 1.3
"""Half-widths of intervals of 95 % by which the other quantities must show the factor."""


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


def rescaled(model: IdentifiedRobot, tests: Sequence[Change]) -> Rescaled | None:
    """Axis and factor that explain all that is marked of a run against another one.

    Parameters
    ----------
    model : IdentifiedRobot
        Of the other run.
    tests : sequence of Change
        All that was tested between both.
    """
    marked = sum(each.marked for each in tests)
    if model.torque_effect is None or not marked:
        return None
    found = (_by_axis(model, axis, tests, marked) for axis in range(model.robot.n_joints))
    best = [each for each in found if each is not None]
    return min(best, key=lambda each: each.half_width / abs(each.share), default=None)


def _by_axis(
    model: IdentifiedRobot, axis: int, tests: Sequence[Change], marked: int
) -> Rescaled | None:
    effect = np.array([_effect(model, axis, each) for each in tests])
    sizes = np.array([each.size for each in tests])
    shown = effect / np.array([each.half_width or np.inf for each in tests])
    if np.count_nonzero(shown) < 2:
        return None
    share, half = _fitted(effect, sizes, shown)
    others = np.arange(len(tests)) != np.argmax(np.abs(shown))
    by_others, half_by_others = _fitted(effect[others], sizes[others], shown[others])
    left = adjusted([each.less(share * e) for each, e in zip(tests, effect.tolist(), strict=True)])
    if any(each.marked for each in left) or by_others * np.sign(share) < SURE * half_by_others:
        return None
    first = tests[0]
    return Rescaled(first.run, first.against, axis + 1, share, half, marked)


def _fitted(effect: Array, sizes: Array, shown: Array) -> tuple[float, float]:
    """Share by weighted least squares, and half of its interval of 95 %; `shown`: over errors."""
    errors = np.divide(effect, shown, out=np.ones_like(effect), where=shown != 0)
    information = float(shown @ shown)
    return float(shown @ (sizes / errors)) / information, 1.0 / float(np.sqrt(information))


def _effect(model: IdentifiedRobot, axis: int, each: Change) -> float:
    """Change of a quantity per relative change of the axis's torque."""
    assert model.torque_effect is not None  # noqa: S101 - asked for before
    if each.quantity.axis is None:
        return float(model.torque_effect[model.names.index(each.quantity.name), axis])
    return each.before if each.quantity.axis == axis + 1 else 0.0
