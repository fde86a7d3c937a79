"""Switching on a plant: the machine of a plant file, and drives with personalities.

A personality changes communication and units of a drive, never the machine, so that equal seeds
give equal motion and noise for all personalities.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sim_plant.canopen.eds import drive_entries
from sim_plant.personality import load_personality
from sim_plant.physics import state as st
from sim_plant.plant import load_plant

if TYPE_CHECKING:
    from sim_plant.drive_settings import DriveSettings
    from sim_plant.personality import Personality
    from sim_plant.plant import Plant
    from sim_plant.servo_axis import ServoAxis


def load_machine(
    name_or_path: str, seed: int | None = None, personality: str | None = None
) -> Plant:
    """Build a packaged plant by name, or the plant of a plant file.

    Parameters
    ----------
    name_or_path : str
    seed : int, optional
        Seed instead of the file's.
    personality : str, optional
        Personality of all drives, by name or path, instead of those of the plant file. A relative
        path in the plant file begins at the folder of that file.

    Raises
    ------
    FileError
        No such plant or personality, or a file that does not fit.
    """
    plant = load_plant(name_or_path, seed)
    folder = Path(name_or_path).parent
    for axis, described in enumerate(plant.file.axes):
        wanted = personality or _found(folder, described.drive.personality)
        if wanted is not None:
            give_personality(plant, axis, load_personality(wanted))
    return plant


def _found(folder: Path, stated: str | None) -> str | None:
    beside = folder / (stated or "")
    return str(beside) if beside.is_file() else stated


def give_personality(plant: Plant, axis: int, personality: Personality) -> None:
    """Set the personality of the drive of an axis (from 0), before the plant is switched on.

    Raises
    ------
    FileError
        The personality does not fit the drives of the plant.
    """
    drive_entries(personality)
    drives = list(plant.drives)
    own = replace(drives[axis], personality=personality)
    if personality.counts_per_turn is not None:
        own = _recounted(own, plant.axes[axis])
    drives[axis] = own
    plant.drives = tuple(drives)
    count = personality.current.milliampere if personality.current else None
    if count is not None:
        plant.const[axis, st.CURRENT_PER_MILLE] *= 1000 * count / drives[axis].rated_current


def _recounted(drive: DriveSettings, servo: ServoAxis) -> DriveSettings:
    """Convert a servo and the limits of its drive to the drive's unit of position."""
    factor = float(drive.counts_per_revolution / drive.increments_per_revolution)
    servo.recount(factor)
    low, high = (round(factor * limit) for limit in drive.software_limits)
    return replace(
        drive,
        software_limits=(low, high),
        max_acceleration=math.ceil(factor * drive.max_acceleration),
    )
