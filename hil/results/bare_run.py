"""What a whole run without a load gives to a short one with it."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import Mismatch, NoLoad
from hil.estimation.identify import estimate
from hil.estimation.load_columns import load_columns
from hil.estimation.noise_levels import noise_levels
from hil.estimation.simultaneous import SimultaneousFit
from hil.estimation.two_step_methods import prepared_for
from hil.friction.law import friction_torque
from hil.model.robot import Robot
from hil.model.robot_file import LINK_PARAMETERS
from hil.planning.measurement import shows_element
from hil.results.naming import named
from hil.runs.pooling import recorded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.estimation.estimate import Estimate
    from hil.estimation.noise_levels import Levels
    from hil.runs.run import Run

    Array = NDArray[np.float64]

_UNKNOWN_FRICTION = 0.1
"""Of an axis without a law of friction, as share of its torque limit."""


@dataclass(frozen=True, slots=True, eq=False)
class BareRun:
    """A run without a load, identified.

    Attributes
    ----------
    run : Run
    estimate : Estimate
    fit : SimultaneousFit
    levels : Levels
        Its noise, and its information.
    columns : ndarray, shape (n_base, 10)
        Change of the base parameters by each parameter of a load.
    free : ndarray, shape (10, n_free)
        How the free parameters make up those of a load.
    wider : Robot, optional
        The robot with all parameters of the last link, where they are taken in.
    """

    run: Run
    estimate: Estimate
    fit: SimultaneousFit
    levels: Levels
    columns: Array
    free: Array
    wider: Robot | None = None

    @property
    def robot(self) -> Robot:
        """The robot that was measured."""
        return self.wider or self.run.robot

    def beside_axis(self) -> BareRun:
        """The same with all ten parameters of the last link present, of robot and load, none tied.

        Robot files leave out what the bare last link does not have; a load that is mounted beside
        its axis has first moments and products of inertia all the same. Itself, where nothing is
        left out.
        """
        stated, number = self.run.robot, str(self.run.robot.n_joints)
        joints = stated.file.joints
        last = joints[-1].model_copy(update={"parameters": LINK_PARAMETERS})
        ties = tuple(tie for tie in stated.file.ties if number not in re.findall(r"\d+", tie))
        if set(joints[-1].parameters) == set(LINK_PARAMETERS) and ties == stated.file.ties:
            return self
        file = stated.file.model_copy(update={"joints": (*joints[:-1], last), "ties": ties})
        robot = Robot(file, stated.source, stated.text)
        fit = SimultaneousFit(robot, prepared_for(stated, self.estimate, recorded(self.run)))
        columns, free = load_columns(robot)
        return replace(self, fit=fit, columns=columns, free=free, wider=robot)

    @property
    def shown(self) -> Array:
        """Change of the base parameters by each free parameter, shape (n_base, n_free)."""
        shown: Array = self.columns @ self.free
        return shown

    def friction(self) -> Array:
        """Highest friction of each axis, slow or fast, shape (n_joints,) [N m or N]."""
        robot, law = self.robot, self.estimate.friction_law
        unknown: Array = _UNKNOWN_FRICTION * robot.torque_limit
        if law is None:
            return unknown
        shares = np.array([0.1, 0.5, 1.0, -0.1, -0.5, -1.0])
        qd = np.outer(shares, robot.velocity_limit)
        found = [
            friction_torque(robot, law, np.zeros((1, len(each))), each[None], 0 * each[None])[0]
            for each in qd
        ]
        highest: Array = np.abs(found).max(axis=0)
        return np.where(highest > 0, highest, unknown)


def know(run: Run) -> BareRun:
    """Identify a run without a load.

    Raises
    ------
    FileError
        A damaged recording.
    Mismatch
        Imported recordings.
    NoLoad
        A robot file that states no parameter of the last link.
    NotIdentifiable
        A run that does not determine its base parameters.
    """
    if run.imported:
        raise Mismatch(
            f"{run.path}: was imported, and a load is measured beside a run of the same drives;"
            " import a recording with the load and take: hil payload WITHOUT LOADED"
        )
    columns, free = load_columns(run.robot)
    if not free.size:
        raise NoLoad(
            f"{run.robot.name}: no parameter of the last link is present in the robot file, so a"
            " load would show nowhere; add m, sx, sy, sz and inertias to its parameters"
        )
    with named(run):
        found = estimate(run.robot, recorded(run))
        prepared = prepared_for(run.robot, found, recorded(run))
        levels = noise_levels(run.robot, [(m, s) for m, s in prepared if shows_element(m)])
    fit = SimultaneousFit(run.robot, prepared)
    return BareRun(run, found, fit, levels, columns, free)
