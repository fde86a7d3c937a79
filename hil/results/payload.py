"""A load from two run folders: Table 3 of our robot, and the drives' gains by a known mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import InvalidValue, Mismatch
from hil.estimation.identify import estimate
from hil.estimation.payload import estimate_payload, require_load
from hil.estimation.payload_figures import MASS
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.torque_constants import drive_gains
from hil.estimation.two_step_methods import prepared_for
from hil.results.naming import named
from hil.results.payload_of_free_motions import LoadOfFreeMotions
from hil.results.stamp import same_recordings
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.payload_figures import Payload
    from hil.estimation.torque_constants import Gains
    from hil.model.robot import Robot
    from hil.runs.run import Run

    Array = NDArray[np.float64]

FACTOR = 1.5
"""Between a stated mass and the one found, beyond which torque constants cannot be the reason."""
SURE = 4.0
"""Standard errors that the mass found may be off."""


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
    assumed : ndarray, shape (n_joints,)
        What the gains are compared with: torque constants [N m/A], or for imported runs 1, NaN
        where the map leaves the gain unknown.
    own : Estimate or None
        Of the loaded run alone, as reports find it; None where it has none.
    """

    robot: Robot
    before: Estimate
    after: Estimate
    payload: Payload
    gains: Gains | None
    assumed: Array
    own: Estimate | None


def find_payload(
    without: Run, loaded: Run, mass: float | None = None, *, gains: bool = False
) -> FoundPayload:
    """Estimate both runs anew and find the load that makes the difference.

    Parameters
    ----------
    mass : float, optional
        Of the load, if it is known [kg]: it is held. Of runs measured by strokes the torque
        constants are found by it too.
    gains : bool
        Whether the gains of imported runs are found by the mass too.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Runs of different robots or kinds, the same run twice, or a mass that contradicts them.
    InvalidValue
        Gains without a mass.
    NotIdentifiable, NoLoad
        Measurements that do not suffice, no load that stands out of its error, or a robot file
        without anything that a load changes.
    """
    if gains and mass is None:
        raise InvalidValue("gains are found by the load's mass; state it too")
    _refuse_unfit(without, loaded)
    if without.imported:
        return _of_free_motions(without, loaded, mass, gains=gains)
    robot = without.robot
    before, after = _estimate(without), _estimate(loaded)
    with named(loaded):
        by_constants = estimate_payload(robot, before, after)
        require_load(by_constants)
        refuse_other_mass(by_constants, mass)
        found = estimate_payload(robot, before, after, mass)
    by_mass = None
    if mass is not None:
        by_mass = drive_gains(robot, _joint(without, before), _joint(loaded, after), mass)
    return FoundPayload(robot, before, after, found, by_mass, robot.torque_constant, after)


def _of_free_motions(without: Run, loaded: Run, mass: float | None, *, gains: bool) -> FoundPayload:
    found = LoadOfFreeMotions(without, loaded, mass, gains=gains)
    assumed = np.ones(without.robot.n_joints)
    if found.gains is not None:
        assumed[np.isnan(found.gains.error)] = np.nan
    return FoundPayload(
        without.robot, *found.estimates, found.payload, found.gains, assumed, found.own
    )


def _refuse_unfit(without: Run, loaded: Run) -> None:
    if without.robot != loaded.robot:
        raise Mismatch(
            f"{loaded.path}: measured with another robot file than {without.path}; use the same"
        )
    if same_recordings(without, loaded):
        raise Mismatch(
            f"{loaded.path}: has the same recordings as {without.path}; name the run without the"
            " load, then the one with it"
        )
    if without.imported != loaded.imported:
        kinds = ["measured", "imported"]
        raise Mismatch(
            f"{loaded.path}: was {kinds[loaded.imported]} and {without.path} was"
            f" {kinds[without.imported]}; a load takes two runs of one kind"
        )


def refuse_other_mass(found: Payload, mass: float | None) -> None:
    """Refuse a stated mass that no error of torque constants explains.

    Raises
    ------
    Mismatch
    """
    m, error = found.phi[MASS], float(np.sqrt(found.phi_covariance[MASS, MASS]))
    if mass is None or not error:
        return
    off = SURE * error
    if not mass / FACTOR - off <= m <= mass * FACTOR + off:
        raise Mismatch(
            f"a mass of {mass:g} kg contradicts {m:.4g} ± {error:.2g} kg by these runs, more than"
            f" {FACTOR:g} times of either; correct the mass: no torque constant is so far off"
        )


def _estimate(run: Run) -> Estimate:
    with named(run):
        return estimate(run.robot, recorded(run))


def _joint(run: Run, found: Estimate) -> SimultaneousFit:
    return SimultaneousFit(run.robot, prepared_for(run.robot, found, recorded(run)))
