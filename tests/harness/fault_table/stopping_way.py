"""Longest distance of an axis after the end of a session, by docs/explanation/safety.md.

An axis keeps its speed while the drives cannot be reached, at most until their watchdogs act, and
during the delay of a stop. Then it decelerates as stated in the drives file, within a margin and
the following error window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from drivers.cia402.stop import STOP_DELAY, STOP_MARGIN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from drivers.drives_file import DrivesFile


def reaction_time(outage: float, drives: DrivesFile) -> float:
    """Return the time after an event in which an axis may continue as commanded [s].

    Parameters
    ----------
    outage : float
        Duration of the outage [s].
    drives : DrivesFile
    """
    return min(outage, drives.heartbeat_timeout) + STOP_DELAY


def allowed_ways(
    speeds: NDArray[np.float64], outage: float, drives: DrivesFile
) -> NDArray[np.float64]:
    """Return the longest distance of each axis [rad].

    Parameters
    ----------
    speeds : ndarray, shape (n_axes,)
        Highest speed within the reaction time: an axis that has just been given a set-point is
        slow at the event and gathers speed while nobody can reach its drive [rad/s].
    outage, drives
        As for `reaction_time`.
    """
    deceleration = np.array([axis.limits.acceleration for axis in drives.axes])
    window = np.array([axis.following_error_window for axis in drives.axes])
    ramp = speeds**2 / (2 * deceleration)
    return speeds * reaction_time(outage, drives) + STOP_MARGIN * ramp + window
