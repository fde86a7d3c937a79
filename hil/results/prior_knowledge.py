"""What earlier runs of a robot teach for the next plan: its noise, and what is known already."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.errors import NotEnoughData
from hil.estimation.drive_train_search import find_drive_train
from hil.estimation.noise_levels import noise_levels
from hil.estimation.two_step_methods import prepare
from hil.planning.measurement import shows_element
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
    drive_train = find_drive_train(robot, raw)
    return noise_levels(
        robot, [(m, drive_train.applied(robot, s)) for m, s in raw if shows_element(m)]
    )
