"""What the friction of all axes changed by together: the temperature of the machine.

A machine that was at work before a campaign has less friction on every axis than one that stood
still over night, by a quarter and more, and no campaign of minutes shows that within itself. What
is worn, loose or dragging shows on its axis alone. So the median over the axes of the relative
change of their friction is put down to temperature, and an axis is judged by what is beyond. Gears
differ in how they take temperature, which a share of the common change allows for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.results.quantities import Quantity, Reading

FEWEST = 3
"""Axes below which one that changed could not be told from the others."""
GREATEST = 0.5
"""Share beyond which a common change is no matter of temperature."""
UNLIKE = 0.5
"""Share of the common change by which an axis may differ from the others."""


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
