"""What a run shows against its robot file: left-out parameters, needless ones, Fig. 7."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.errors import Mismatch
from hil.estimation.absent_parameters import examine
from hil.estimation.gravity_phase import Phase, shifted_most
from hil.estimation.identify import estimate
from hil.estimation.two_step_methods import prepared_for
from hil.results.naming import named
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from hil.estimation.absent_parameters import ModelErrors
    from hil.estimation.estimate import Estimate
    from hil.model.robot import Robot
    from hil.runs.run import Run


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Findings of one run; `phase` is None where nothing left out shows in gravity torques."""

    robot: Robot
    estimate: Estimate
    errors: ModelErrors
    phase: Phase | None


def diagnose(run: Run) -> Diagnosis:
    """Estimate a run anew and test its robot file.

    Raises
    ------
    NotIdentifiable
        Measurements that do not suffice.
    Mismatch
        A run that was imported.
    """
    if run.imported:
        raise Mismatch(
            f"{run.path}: was imported, and a diagnosis compares measurements of one element at a"
            " time, which only hil run makes; to test a link parameter by imported recordings, add"
            " it to the parameters in the robot file, import and identify again, and see whether"
            " its interval holds zero"
        )
    recordings = list(recorded(run))
    robot = run.robot
    with named(run):
        best = estimate(robot, recordings)
    errors = examine(robot, prepared_for(robot, best, recordings))
    shifted = shifted_most(best, errors, robot.torque_limit) if errors.found else None
    return Diagnosis(robot, best, errors, shifted)
