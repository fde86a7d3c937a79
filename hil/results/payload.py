"""A load from two run folders: Table 3 of our robot, and the drives' gains by a known mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.errors import Mismatch
from hil.estimation.identify import estimate, prepared_for
from hil.estimation.payload import estimate_payload
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.torque_constants import drive_gains
from hil.results.naming import named
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.estimation.estimate import Estimate
    from hil.estimation.payload import Payload
    from hil.estimation.torque_constants import Gains
    from hil.model.robot import Robot
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class FoundPayload:
    """What two runs give of a load.

    Attributes
    ----------
    robot : Robot
    before, after : Estimate
        Without and with it.
    payload : Payload
    gains : Gains or None
        Where the mass was stated.
    """

    robot: Robot
    before: Estimate
    after: Estimate
    payload: Payload
    gains: Gains | None


def find_payload(without: Run, loaded: Run, mass: float | None = None) -> FoundPayload:
    """Estimate both runs anew and take the load from their difference.

    Parameters
    ----------
    mass : float, optional
        Of the load, if it is known [kg]: it is held, and the torque constants are checked by it.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Runs of different robots.
    NotIdentifiable, NoLoad
        Measurements that do not suffice, or a robot file without anything that a load changes.
    """
    robot = without.robot
    if robot != loaded.robot:
        raise Mismatch(
            f"{loaded.path}: measured with another robot file than {without.path}; use the same"
        )
    before, after = _estimate(without), _estimate(loaded)
    with named(loaded):
        found = estimate_payload(robot, before, after, mass)
    gains = None
    if mass is not None:
        gains = drive_gains(robot, _joint(without, before), _joint(loaded, after), mass)
    return FoundPayload(robot, before, after, found, gains)


def _estimate(run: Run) -> Estimate:
    with named(run):
        return estimate(run.robot, recorded(run))


def _joint(run: Run, found: Estimate) -> SimultaneousFit:
    return SimultaneousFit(run.robot, prepared_for(run.robot, found, recorded(run)))
