"""Whether current sensors read zero where no current can flow: with the power stage off.

Looked at before the axes are energised and after they were switched off. A constant offset is no
reason to stop, for an estimate of friction absorbs it, but the operator shall know. Where an axis's
telegram is missing, its current is that of a SYNC before, when its power may have been on.
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
"""SYNCs whose samples are averaged, as far as they came in time."""

_ENERGISED = 1 << 2
"""Bit of the statusword: operation enabled."""
_OLD = SampleFlag.MISSING | SampleFlag.LATE
OFFSET = 0.02
"""Share of an axis's torque limit that its sensor may read with power off."""


def offsets(
    process_data: ProcessData, axes: Sequence[Axis], cycle: Callable[[], object], when: str
) -> list[str]:
    """Let some SYNCs pass with all power stages off; return which sensors do not read zero.

    Parameters
    ----------
    process_data : ProcessData
        Of all axes.
    axes : sequence of Axis
        In joint order.
    cycle : callable
        Lets one SYNC pass.
    when : str
        For the message.
    """
    seen: list[list[float]] = [[] for _ in axes]
    for _ in range(SYNCS):
        cycle()
        shown = process_data.words, process_data.currents, process_data.flags
        for readings, word, current, flag in zip(seen, *shown, strict=True):
            if not (flag & _OLD or word & _ENERGISED):  # another master may have switched it on
                readings.append(current)
    found = []
    for axis, readings in zip(axes, seen, strict=True):
        if not readings:  # of a silent drive nothing is known
            continue
        current, bound = math.fsum(readings) / len(readings), OFFSET * axis.stated.limits.torque
        torque = abs(current * axis.scale.torque)
        if torque > bound:
            unit = axis.stated.effort_unit
            found.append(
                f"{axis.label}: {when} its current reads {torque:.3g} {unit}, at "
                f"most {bound:.3g} {unit} may be; the torques of this axis carry that offset: have "
                "it adjusted, and measure the axis again if it was not there from the start"
            )
    return found
