"""What earlier runs of a robot teach for the next plan: its noise, and what is known already."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import NotEnoughData
from hil.estimation.identify import prepare
from hil.estimation.noise_levels import noise_levels
from hil.estimation.torque_lag import find_lags
from hil.runs.pooling import pooled

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.estimation.noise_levels import Levels
    from hil.runs.run import Run


def experience(folders: Sequence[Run]) -> Levels:
    """Noise that runs of one robot show, and what they show of its parameters.

    Raises
    ------
    FileError
        A damaged recording.
    NotEnoughData
        No measurement of use.
    """
    robot = folders[0].robot
    raw, _ = prepare(pooled(folders))
    if not raw:
        raise NotEnoughData(
            f"{folders[0].path}: no measurement of gravity, inertia or coupling is there; measure"
            " some with --resume"
        )
    lag = find_lags(robot, raw).lag
    return noise_levels(robot, [(measurement, s.torque_advanced(lag)) for measurement, s in raw])
