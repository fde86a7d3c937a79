"""Offset of current sensors, measured with the power stage off.

Measured before the axes are energised and after power-off. A constant offset does not stop a run,
since the friction estimate absorbs it, but is reported. Samples without a telegram are left out:
their currents are those of an earlier SYNC, when power may have been on.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.drive_bus import SampleFlag

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData

SYNCS = 10
"""SYNCs averaged, except those without a timely telegram."""

_ENERGISED = 1 << 2
"""Bit of the statusword: operation enabled."""
_OLD = SampleFlag.MISSING | SampleFlag.LATE
OFFSET = 0.02
"""Largest offset, as a share of the torque limit."""


def measure_offsets(
    process_data: ProcessData, axes: Sequence[Axis], cycle: Callable[[], object], when: str
) -> list[str]:
    """Let some SYNCs pass with all power stages off; return a message for each sensor offset.

    Parameters
    ----------
    process_data : ProcessData
    axes : sequence of Axis
        Axes in joint order.
    cycle : callable
        Lets one SYNC pass.
    when : str
        Occasion, for the message.
    """
    seen: list[list[float]] = [[] for _ in axes]
    for _ in range(SYNCS):
        cycle()
        shown = process_data.words, process_data.currents, process_data.flags
        for readings, word, current, flag in zip(seen, *shown, strict=True):
            if not (flag & _OLD or word & _ENERGISED):  # perhaps switched on by another master
                readings.append(current)
    found = []
    for axis, readings in zip(axes, seen, strict=True):
        if not readings:  # a silent drive
            continue
        current, bound = math.fsum(readings) / len(readings), OFFSET * axis.stated.limits.torque
        torque = abs(current * axis.scale.torque)
        if torque > bound:
            unit = axis.stated.effort_unit
            found.append(
                f"{axis.label}: {when} its current reads {torque:.3g} {unit}, at most "
                f"{bound:.3g} {unit} allowed; all torques of this axis include this offset: have "
                "the offset adjusted, and measure the axis again if the offset is new"
            )
    return found
