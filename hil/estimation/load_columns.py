"""What a load at the last link adds to the base parameters: K_n phi.

K_n are the columns of K (p = K p_standard) that belong to the last link n. Of the load's ten
parameters phi those are free that the robot file calls present there, tied as it ties them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hil.estimation.payload_figures import MASS
from hil.model.base_parameters import base_parameters
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from hil.model.robot import Robot

    Array = NDArray[np.float64]

_SHOWN = 1e-9


def load_columns(robot: Robot) -> tuple[Array, Array]:
    """K_n, shape (n_base, 10), and how the free parameters make up phi, shape (10, n_free)."""
    own = slice(10 * (robot.n_joints - 1), 10 * robot.n_joints)
    names = robot.link_parameters[own]
    carriers = [name for name in names if name in robot.present and name not in robot.ties]
    free = np.array([
        [float(robot.ties.get(name, name) == carrier and name in robot.present)
         for carrier in carriers] for name in names
    ]).reshape(10, len(carriers))  # fmt: skip
    K = base_parameters(robot).matrix[:, own]
    shown = np.abs(K @ free).max(axis=0, initial=0.0) > _SHOWN
    return K, free[:, shown]


def payload_names(robot: Robot) -> tuple[tuple[str, ...], tuple[tuple[int, str], ...]]:
    """Of the load's ten parameters those that the robot file takes as zero, and the others.

    Returns
    -------
    absent : tuple of str
    present : tuple of (int, str)
        With their places in eq. (4).
    """
    last = {name[: -len(str(robot.n_joints))] for name in robot.present if _of_last(robot, name)}
    absent = tuple(name for name in LINK_PARAMETERS if name not in last)
    return absent, tuple((k, name) for k, name in enumerate(LINK_PARAMETERS) if name in last)


def without_mass(free: Array) -> Array:
    """Columns of the free parameters but that of the mass."""
    return free[:, free[MASS] == 0]


def _of_last(robot: Robot, name: str) -> bool:
    return name in robot.link_parameters[10 * (robot.n_joints - 1) :]
