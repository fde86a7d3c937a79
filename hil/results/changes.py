"""Test of changes of a quantity between two runs against chance and temperature.

The difference d of two independent readings has the variance s^2 of both and their effective
degrees of freedom (Welch, Satterthwaite). The value of an unchanged machine may differ by the
allowance a. The hypothesis is |d| <= a, and the p-value is that for |d| = a,

p = P(T >= (|d| - a) / s) + P(T >= (|d| + a) / s),

with Student's T; for a = 0 it is the usual two-sided p-value. All quantities of a new run are
tested against two earlier runs. Holm's step-down procedure (1979) bounds the probability that any
quantity is marked by chance, even if the quantities are correlated: a false mark appears in at most
`SIGNIFICANT` of the runs of an unchanged machine.

A machine that worked before a campaign has less friction on every axis than one that rested over
night, by a quarter and more, and a campaign of minutes does not show this by its own data. Wear,
looseness or dragging appear on a single axis. Therefore the median over the axes of the relative
change of friction is attributed to temperature, and each axis is judged by its deviation from the
median. Gears differ in their response to temperature, and the allowance contains a share of the
common change.

All torques of one axis may change by one factor, after an exchange of the drive or of its torque
constant. A factor 1 + d changes the base parameters by d times their sensitivity (`torque_effect`
of a model), and friction and offset of the axis by the share d. The factor is fitted to the
differences of two runs by least squares weighted by errors and allowances. It is stated under two
conditions: with it no quantity remains marked, and the fit without the most influential quantity
still shows a factor of the same sign. A load, a screw or a bearing changes only some of the
quantities of an axis, and by different shares.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.intervals import SIGNIFICANT, welch_degrees
from hil.show.rounding import probability, rounded, signed, significant, uncertain, unit
from hil.show.table import Column, Table, figures, table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from hil.arrays import Array, Indices
    from hil.results.identified_robot import IdentifiedRobot
    from hil.results.quantities import Kind, Quantity, Reading
    from hil.show.table import Row


FEWEST = 3
"""Minimum number of axes for a median that a single changed axis does not shift."""
GREATEST = 0.5
"""Largest common change attributed to temperature."""
UNLIKE = 0.5
"""Difference between the axes' responses to temperature, as a share of the common change."""
MEANINGS: dict[Kind, str] = {
    "gravity parameter": "a load, counterweight, spring or cable, or the torque constant",
    "inertia parameter": "something mounted, shifted or loose, or the torque constant",
    "friction level": "bearing, gear, seal, lubricant, a dragging brake or a loose screw",
    "offset": "an offset of the torque or current sensor, or a constant force such as a hose",
}
"""Possible reasons for a change, by the kind of quantity."""


class Change(NamedTuple):
    """Difference of a quantity between two runs.

    Attributes
    ----------
    run, against : str
        Labels of the newer and of the earlier run.
    before : float
        Value in the earlier run [unit of the quantity]; a friction level includes the change common
        to all axes.
    size : float
        Value of the newer run less `before`.
    half_width : float
        Half-width of the 95 % interval of `size`, with the allowance.
    p_value : float
        Probability of a difference of at least `size` without a change of the machine.
    adjusted : float
        P-value adjusted for all tests of the run (Holm).
    allowance, error, degrees : float
        Permitted difference of an unchanged machine; standard error of `size`, and its degrees of
        freedom.
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
        """Return the change after subtracting an explained part, with the p-value of the rest."""
        size = self.size - explained
        p = float(p_values(abs(size), self.allowance, self.error, self.degrees))
        return self._replace(size=size, p_value=p, adjusted=1.0)

    @property
    def marked(self) -> bool:
        """True if the change is significant."""
        return self.adjusted < SIGNIFICANT

    @property
    def relative(self) -> float | None:
        """Size as a share of the previous value; None for a previous value of zero."""
        return self.size / abs(self.before) if self.before else None

    @property
    def meaning(self) -> str:
        """Possible reasons for the change."""
        return MEANINGS[self.quantity.kind]

    @property
    def sentence(self) -> str:
        """Size, interval, p-value and possible reasons."""
        size = rounded(self.size, self.half_width)
        half = rounded(self.half_width, self.half_width)
        share = f" ({signed(significant(100 * self.relative, 2))} %)" if self.relative else ""
        p = "< 0.0001" if self.adjusted < 1e-4 else f"= {self.adjusted:.2g}"
        return (
            f"{self.run}: {self.quantity.title} changed by {size} ± {half} "
            f"{unit(self.quantity.unit)}{share} since {self.against}, p "
            f"{p}; possible cause: {self.meaning}"
        )


def change(
    quantity: Quantity, run: tuple[str, Reading], against: tuple[str, Reading], common: float = 0.0
) -> Change:
    """Return the difference of a quantity between two labelled runs, with an unadjusted p-value.

    For a level of friction, the common share `common` of all axes is subtracted first.
    """
    new, old = run[1], against[1]
    if quantity.kind == "friction level":
        allowance = old.allowance + UNLIKE * abs(common * old.value)
        old = old._replace(value=old.value * (1.0 + common), allowance=allowance)
    variances = np.array([new.standard_error**2, old.standard_error**2])
    error = float(np.sqrt(variances.sum()))
    freedom = np.array([new.degrees, old.degrees])
    degrees = float(welch_degrees(np.ones(2), variances, freedom))
    allowance, size = max(new.allowance, old.allowance), new.value - old.value
    half = allowance + float(special.stdtrit(degrees, 0.975)) * error
    p = float(p_values(abs(size), allowance, error, degrees))
    return Change(
        run[0], against[0], quantity, old.value, size, half, p,
        allowance=allowance, error=error, degrees=degrees,
    )  # fmt: skip


def common_friction(
    quantities: Sequence[Quantity], new: Sequence[Reading | None], old: Sequence[Reading | None]
) -> float:
    """Return the common relative change of friction; 0 if known for too few axes."""
    shares = {
        (quantity.axis, quantity.name): now.value / then.value - 1.0
        for quantity, now, then in zip(quantities, new, old, strict=True)
        if quantity.kind == "friction level" and quantity.axis and now and then and then.value
    }
    axes = np.array([axis for axis, _ in shares], dtype=int)
    (common,) = common_shares(np.array([list(shares.values())], dtype=float), axes)
    return float(np.nan_to_num(common))


def common_shares(shares: Array, axes: Indices) -> Array:
    """Return the common relative change of friction in each run, shape (n,).

    Parameters
    ----------
    shares : ndarray, shape (n, n_levels)
        Relative changes of friction levels; NaN if unknown.
    axes : ndarray of int, shape (n_levels,)
        Axes of the levels.

    Returns
    -------
    ndarray, shape (n,)
        Median over the axes; 0 beyond `GREATEST`, NaN for fewer than `FEWEST` axes.
    """
    if not axes.size:
        return np.full(len(shares), np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean and median of no values are NaN
        each = np.array([np.nanmean(shares[:, axes == k], axis=1) for k in np.unique(axes)])
        common = np.nanmedian(each, axis=0)
    common = np.where(np.isfinite(each).sum(axis=0) < FEWEST, np.nan, common)
    return np.where(np.abs(common) > GREATEST, 0.0, common)


def p_values(size: ArrayLike, allowance: ArrayLike, error: ArrayLike, degrees: ArrayLike) -> Array:
    """Return the p-values of absolute differences `size`; NaN for unknown sizes or errors."""
    size, allowance = np.asarray(size, dtype=float), np.asarray(allowance, dtype=float)
    with np.errstate(invalid="ignore", divide="ignore"):
        beyond = np.stack([size - allowance, size + allowance]) / error
        p = special.stdtr(degrees, -beyond).sum(axis=0)
    # without uncertainty any difference beyond the allowance is a change
    certain = np.where(np.isnan(size), np.nan, np.where(size > allowance, 0.0, 1.0))
    return np.asarray(np.where(np.equal(error, 0.0), certain, p))


def adjusted(tests: Sequence[Change]) -> tuple[Change, ...]:
    """Return the tests with p-values adjusted by Holm's procedure, the least probable first."""
    ordered = sorted(tests, key=lambda test: test.p_value)
    weighted = [min((len(ordered) - k) * test.p_value, 1.0) for k, test in enumerate(ordered)]
    steps = np.maximum.accumulate(np.array(weighted)) if weighted else np.array([])
    return tuple(test._replace(adjusted=float(p)) for test, p in zip(ordered, steps, strict=True))


SURE = 1.3
"""Minimum factor of an axis's torques in the fit without the most influential quantity, in
half-widths of its 95 % interval."""


class Rescaled(NamedTuple):
    """Common factor of an axis's torques, relative to the previous run or the reference.

    Attributes
    ----------
    axis : int
        Number from 1.
    share, half_width : float
        Change of all torques of the axis, and half of its interval of 95 %.
    explained : int
        Number of marked quantities explained by the factor.
    """

    run: str
    against: str
    axis: int
    share: float
    half_width: float
    explained: int

    @property
    def sentence(self) -> str:
        """Sentence on the axis, the factor with its interval, and the explained changes."""
        half = 100 * self.half_width
        return (
            f"{self.run}: torque constant or drive of axis {self.axis} exchanged or rescaled: all"
            f" torques of the axis changed by {signed(rounded(100 * self.share, half))} ±"
            f" {rounded(half, half)} % since {self.against}, which explains all"
            f" {self.explained} marked changes"
        )


def rescaled(model: IdentifiedRobot, tests: Sequence[Change]) -> Rescaled | None:
    """Return the torque factor of an axis that explains all marked changes between two runs.

    Parameters
    ----------
    model : IdentifiedRobot
        Model of the earlier run.
    tests : sequence of Change
        All tests between the two runs.
    """
    marked = sum(each.marked for each in tests)
    if model.torque_effect is None or not marked:
        return None
    found: list[Rescaled] = []
    for axis, of_base in enumerate(model.torque_effect.T.tolist(), start=1):
        effects = dict(zip(model.names, of_base, strict=True))
        # change of each quantity per relative change of the axis's torque
        effect = np.array([
            effects[each.quantity.name] if each.quantity.axis is None
            else each.before if each.quantity.axis == axis else 0.0
            for each in tests
        ])  # fmt: skip
        sizes = np.array([each.size for each in tests])
        shown = effect / np.array([each.half_width or np.inf for each in tests])
        if np.count_nonzero(shown) < 2:
            continue
        share, half = _fitted(effect, sizes, shown)
        others = np.arange(len(tests)) != np.argmax(np.abs(shown))
        by_others, half_by_others = _fitted(effect[others], sizes[others], shown[others])
        pairs = zip(tests, effect.tolist(), strict=True)
        left = adjusted([each.less(share * per_unit) for each, per_unit in pairs])
        if any(each.marked for each in left) or by_others * np.sign(share) < SURE * half_by_others:
            continue
        found.append(Rescaled(tests[0].run, tests[0].against, axis, share, half, marked))
    return min(found, key=lambda each: each.half_width / abs(each.share), default=None)


def _fitted(effect: Array, sizes: Array, shown: Array) -> tuple[float, float]:
    """Fit a share with its half-width by least squares; `shown` is `effect` over the errors."""
    errors = np.divide(effect, shown, out=np.ones_like(effect), where=shown != 0)
    information = float(shown @ shown)
    return float(shown @ (sizes / errors)) / information, 1.0 / float(np.sqrt(information))


def changed_table(changes: Sequence[Change], title: str = "What changed", of: str = "run") -> Table:
    """Return the table of significant changes; no rows without any."""
    return table(
        title,
        (
            *(Column(head, folds=True) for head in (of, "since", "quantity")),
            *figures("change", "± 95 %"),
            "unit",
            *figures("change, %", "p"),
            Column("possible cause", folds=True),
        ),
        map(_change, changes),
        "The interval includes the possible effect of temperature on friction; p: probability of "
        "such a change by chance, over all tests of the run (Holm).",
    )


def _change(each: Change) -> Row:
    share = "" if each.relative is None else signed(significant(100 * each.relative, 2))
    size, half = uncertain(each.size, each.half_width)
    return (
        each.run, each.against, each.quantity.title, size, half, unit(each.quantity.unit), share,
        probability(each.adjusted), each.meaning,
    )  # fmt: skip
