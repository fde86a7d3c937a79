"""Whether a quantity changed between two runs by more than chance and temperature explain.

The difference d of two independent readings has the variance s^2 of both and their effective
degrees of freedom (Welch, Satterthwaite). With an allowance a, by which the value may differ though
nothing changed, the hypothesis is |d| <= a, and the p-value is that at its edge,

    p = P(T >= (|d| - a) / s) + P(T >= (|d| + a) / s),

with Student's T; for a = 0 it is the usual one of two sides. Many quantities are tested of a new
run, against two others: Holm's step-down procedure (1979) holds the probability that any of them is
marked by chance, whatever their correlations: in `SIGNIFICANT` of the runs of an unchanged machine
anything is.

A machine that was at work before a campaign has less friction on every axis than one that stood
still over night, by a quarter and more, and no campaign of minutes shows that within itself. What
is worn, loose or dragging shows on its axis alone. So the median over the axes of the relative
change of their friction is put down to temperature, and an axis is judged by what is beyond. Gears
differ in how they take temperature, which a share of the common change allows for.

All torques of one axis may change by one factor: a drive or torque constant exchanged. A factor
1 + d changes the base parameters by d times what the estimator makes of that (`torque_effect` of a
model), and friction and offset of the axis by the share d. The factor that fits the differences of
two runs best, least squares weighted by errors and allowances, is stated only if with it nothing of
what was marked is left, and if what is left without the quantity that determines it most shows a
factor too, of the same sign: a load, a screw or a bearing changes some of these quantities, and not
all by one share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.intervals import SIGNIFICANT, combined_degrees
from hil.show.rounding import rounded, signed, significant, unit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hil.arrays import Array
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.quantities import Kind, Quantity, Reading


FEWEST = 3
"""Axes of which the median is that of the others where one has changed."""
GREATEST = 0.5
"""Share beyond which a common change is no matter of temperature."""
UNLIKE = 0.5
"""Share of the common change by which an axis may differ from the others."""
MEANINGS: dict[Kind, str] = {
    "gravity parameter": "a load, counterweight, spring or cable, or the torque constant",
    "inertia parameter": "something mounted, shifted or loose, or the torque constant",
    "friction level": "bearing, gear, seal, lubricant, a dragging brake or a loose screw",
    "offset": "the zero of the torque or current sensor, or a constant force such as a hose",
}
"""What a change of each kind may come from."""


class Change(NamedTuple):
    """Difference of a quantity between two runs.

    Attributes
    ----------
    run, against : str
        Labels of the newer and of the other run.
    quantity : Quantity
    before : float
        Value in the other run [unit of the quantity]; of a level of friction with what is common to
        all axes.
    size : float
        Value of the run less that of the other.
    half_width : float
        Of the interval of 95 % about `size`, the allowance included.
    p_value : float
        Of a difference at least as great without any change.
    adjusted : float
        The same for all that was tested of the run, by Holm.
    allowance, error, degrees : float
        By which the value may differ without any change; standard error of `size`, and its degrees
        of freedom.
    """

    run: str
    against: str
    quantity: Quantity
    before: float
    size: float
    half_width: float
    p_value: float
    adjusted: float = 1.0
    allowance: float = 0.0
    error: float = 0.0
    degrees: float = 1.0

    def less(self, explained: float) -> Change:
        """The change that is left when some of its size is explained; p-value of it alone."""
        size = self.size - explained
        p = _p_value(abs(size), self.allowance, self.error, self.degrees)
        return self._replace(size=size, p_value=p, adjusted=1.0)

    @property
    def marked(self) -> bool:
        """Whether it is no chance."""
        return self.adjusted < SIGNIFICANT

    @property
    def relative(self) -> float | None:
        """Size as a share of the value before; None where that was zero."""
        return self.size / abs(self.before) if self.before else None

    @property
    def meaning(self) -> str:
        """What it may come from."""
        return MEANINGS[self.quantity.kind]

    @property
    def sentence(self) -> str:
        """Size, interval, p-value and what it may come from."""
        size = rounded(self.size, self.half_width)
        half = rounded(self.half_width, self.half_width)
        share = f" ({signed(significant(100 * self.relative, 2))} %)" if self.relative else ""
        return (
            f"{self.run}: {self.quantity.title} changed by {size} ± {half}"
            f" {unit(self.quantity.unit)}{share} since {self.against}, p {_stated(self.adjusted)};"
            f" it may come from: {self.meaning}"
        )


def change(
    quantity: Quantity, run: tuple[str, Reading], against: tuple[str, Reading], common: float = 0.0
) -> Change:
    """Difference between two runs, each with its label; p-value of this quantity alone.

    Of a level of friction it is that beyond the share `common`, by which all axes' changed.
    """
    new, old = run[1], against[1]
    if quantity.kind == "friction level":
        old = at_other_temperature(old, common)
    variances = np.array([new.standard_error**2, old.standard_error**2])
    error = float(np.sqrt(variances.sum()))
    freedom = np.array([new.degrees, old.degrees])
    degrees = float(combined_degrees(np.ones(2), variances, freedom))
    allowance, size = max(new.allowance, old.allowance), new.value - old.value
    half = allowance + float(special.stdtrit(degrees, 0.975)) * error
    p = _p_value(abs(size), allowance, error, degrees)
    return Change(
        run[0], against[0], quantity, old.value, size, half, p,
        allowance=allowance, error=error, degrees=degrees,
    )  # fmt: skip


def common_friction(
    quantities: Sequence[Quantity],
    new: Sequence[Reading | None],
    old: Sequence[Reading | None],
) -> float:
    """Share by which friction of all axes differs together; 0 where too few axes know it."""
    by_axis: dict[int, list[float]] = {}
    for quantity, now, then in zip(quantities, new, old, strict=True):
        if quantity.kind == "friction level" and quantity.axis and now and then and then.value:
            by_axis.setdefault(quantity.axis, []).append(now.value / then.value - 1.0)
    if len(by_axis) < FEWEST:
        return 0.0
    common = float(np.median([np.mean(shares) for shares in by_axis.values()]))
    return common if abs(common) <= GREATEST else 0.0


def at_other_temperature(level: Reading, common: float) -> Reading:
    """Level of friction as the common change would have made it."""
    allowance = level.allowance + UNLIKE * abs(common * level.value)
    return level._replace(value=level.value * (1.0 + common), allowance=allowance)


def _stated(p: float) -> str:
    return "< 0.0001" if p < 1e-4 else f"= {p:.2g}"


def _p_value(size: float, allowance: float, error: float, degrees: float) -> float:
    if error == 0:  # nothing is uncertain: any difference beyond the allowance is one
        return 0.0 if size > allowance else 1.0
    beyond = np.array([size - allowance, size + allowance]) / error
    return float(special.stdtr(degrees, -beyond).sum())


def adjusted(tests: Sequence[Change]) -> tuple[Change, ...]:
    """Put the p-values for all tests together into each (Holm); the least probable come first."""
    ordered = sorted(tests, key=lambda test: test.p_value)
    weighted = [min((len(ordered) - k) * test.p_value, 1.0) for k, test in enumerate(ordered)]
    steps = np.maximum.accumulate(np.array(weighted)) if weighted else np.array([])
    return tuple(test._replace(adjusted=float(p)) for test, p in zip(ordered, steps, strict=True))


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
    found = (
        _by_axis(axis, dict(zip(model.names, each.tolist(), strict=True)), tests, marked)
        for axis, each in enumerate(model.torque_effect.T)
    )
    best = [each for each in found if each is not None]
    return min(best, key=lambda each: each.half_width / abs(each.share), default=None)


def _by_axis(
    axis: int, effects: Mapping[str, float], tests: Sequence[Change], marked: int
) -> Rescaled | None:
    """Factor of the torque of an axis (from 0); `effects` on base parameters, by name."""
    # change of each quantity per relative change of the axis's torque
    effect = np.array([
        effects[each.quantity.name] if each.quantity.axis is None
        else each.before if each.quantity.axis == axis + 1 else 0.0
        for each in tests
    ])  # fmt: skip
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
