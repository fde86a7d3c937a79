"""Whether current sensors read zero where no current can flow: with the power stage off.

Looked at before the axes are energised and after they were switched off. A constant offset is no
reason to stop, for an estimate of friction absorbs it, but the operator shall know.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from drivers.axis import Axis
    from drivers.cycle_data import ProcessData

SYNCS = 10
"""Samples that are averaged."""

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
    rows = []
    for _ in range(SYNCS):
        cycle()
        rows.append(process_data.currents)
    found = []
    for axis, current in zip(axes, np.mean(rows, axis=0), strict=True):
        torque, bound = abs(float(current) * axis.scale.torque), OFFSET * axis.stated.limits.torque
        if torque > bound:
            unit = axis.stated.effort_unit
            found.append(
                f"{axis.label}: {when} its current reads {torque:.3g} {unit}, at "
                f"most {bound:.3g} {unit} may be; the torques of this axis carry that offset: have "
                "it adjusted, and measure the axis again if it was not there from the start"
            )
    return found
