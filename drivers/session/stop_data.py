"""What is known of each axis when it must stop: how fast it may be, how its drive slows it down.

Both decide how far an axis may go on after a quick stop before its voltage is disabled
(`drivers.cia402.stop`), so a speed is rather too high than too low, and a deceleration rather too
low than too high.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from drivers.axis import AxisScale
from drivers.cia402 import objects
from drivers.commissioning.effective_limits import SLOWEST_STOP
from drivers.safety.trips import SPEED_SHARE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from drivers.canopen.sdo import RemoteDictionary
    from drivers.commissioning.effective_limits import EffectiveLimits
    from drivers.drives_file import AxisDrive


def speeds(
    axes: Sequence[AxisDrive], measured: Sequence[float], commanded: Sequence[float]
) -> list[float]:
    """Return how fast each axis may be [rad/s or m/s]: as measured, or as commanded if faster.

    Parameters
    ----------
    axes : sequence of AxisDrive
        With the limits that hold.
    measured : sequence of float
        Speeds that the encoders show [increments/s]; inf where an axis is not seen.
    commanded : sequence of float
        Speeds that set-points lead to [rad/s or m/s].
    """
    found = []
    for axis, counts, planned in zip(axes, measured, commanded, strict=True):
        limit = axis.limits.velocity
        seen = limit if math.isinf(counts) else counts * abs(AxisScale.of(axis).position)
        fastest = axis.trip.velocity or SPEED_SHARE * limit  # a jump of the encoder is none
        found.append(max(planned, min(seen, fastest)))
    return found


def decelerations(
    stated: Sequence[AxisDrive],
    limits: Sequence[EffectiveLimits],
    servers: Sequence[RemoteDictionary],
    profiles: Sequence[float],
) -> list[float]:
    """Return how each axis slows down in a quick stop [rad/s^2 or m/s^2].

    As the drives file states it, as the drive has it, or as the axis was moved.

    Parameters
    ----------
    stated : sequence of AxisDrive
        The axes as the drives file states them.
    limits : sequence of EffectiveLimits
        Those that hold.
    servers : sequence of RemoteDictionary
        The drives.
    profiles : sequence of float
        Deceleration of each axis's last move [rad/s^2 or m/s^2].
    """
    found = []
    for axis, holding, server, profile in zip(stated, limits, servers, profiles, strict=True):
        slowest = SLOWEST_STOP * axis.limits.acceleration
        ours = max(holding.stop_deceleration or holding.limits.acceleration, slowest)
        if server.missing & {objects.QUICK_STOP_OPTION, objects.QUICK_STOP_DECELERATION}:
            ours = min(ours, profile)  # it may take that of 6084
        found.append(axis.quick_stop_deceleration or ours)
    return found
