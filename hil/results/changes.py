"""Whether a quantity changed between two runs by more than chance and temperature explain.

The difference d of two independent readings has the variance s^2 of both and their effective
degrees of freedom (Welch, Satterthwaite). With an allowance a, by which the value may differ though
nothing changed, the hypothesis is |d| <= a, and the p-value is that at its edge,

    p = P(T >= (|d| - a) / s) + P(T >= (|d| + a) / s),

with Student's T; for a = 0 it is the usual one of two sides. Many quantities are tested of a new
run, against two others: Holm's step-down procedure (1979) holds the probability that any of them is
marked by chance, whatever their correlations: in `SIGNIFICANT` of the runs of an unchanged machine
anything is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special

from hil.estimation.intervals import SIGNIFICANT, combined_degrees
from hil.results.common_friction import at_other_temperature
from hil.results.rounding import rounded, signed, significant

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.quantities import Kind, Quantity, Reading

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
            f"{self.run}: {self.quantity.name} changed by {size} ± {half}"
            f" {self.quantity.unit}{share} since {self.against}, p {_stated(self.adjusted)}; it may"
            f" come from: {self.meaning}"
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
