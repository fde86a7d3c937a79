"""Load at the last link: its parameters and the effect on the base parameters.

A rigid load adds its own ten parameters phi to those of the last link n, so the base parameters
change by K_n phi: K_n are the columns of K (p = K p_standard) for that link. The free parameters of
a load are the parameters of that link present in the robot file, with the same ties.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from hil.errors import NoLoad
from hil.model.base_parameters import base_parameters
from hil.model.robot_file import LINK_PARAMETERS

if TYPE_CHECKING:
    from hil.arrays import Array
    from hil.model.robot import Robot


MASS, FIRST_MOMENTS, INERTIAS = 9, (6, 7, 8), (0, 1, 2, 3, 4, 5)
"""Indices of mass, first moments and inertias in eq. (4)."""


@dataclass(frozen=True, slots=True, eq=False)
class LoadColumns:
    """Effect of a load on the base parameters.

    Attributes
    ----------
    K : ndarray, shape (n_base, 10)
        Change of the base parameters per unit of each load parameter.
    free : ndarray, shape (10, n_free)
        Map from the free parameters to the ten load parameters.
    absent : tuple of str
        Names of parameters stated as zero in the robot file.
    """

    K: Array
    free: Array
    absent: tuple[str, ...]

    @property
    def shown(self) -> Array:
        """Change of the base parameters by each free parameter, shape (n_base, n_free)."""
        return self.K @ self.free

    @property
    def dark(self) -> tuple[str, ...]:
        """Present parameters without effect on any base parameter."""
        lit = np.abs(self.free).max(axis=1) > 0
        rows = zip(LINK_PARAMETERS, lit.tolist(), strict=True)
        return tuple(name for name, is_lit in rows if not is_lit and name not in self.absent)


@lru_cache(maxsize=8)
def load_columns(robot: Robot) -> LoadColumns:
    """Compute the columns of a load at the last link.

    Raises
    ------
    NoLoad
        The robot file states no parameter of the last link affected by a load, or the robot is a
        tree.
    """
    if not robot.is_chain:
        raise NoLoad(
            f"{robot.name}: has {len(robot.last_links)} last links, and a load is identified at "
            "the one of a chain; record both runs with the branch of the load alone: its chain "
            "between --from and --to, or from and to of a map"
        )
    own = slice(10 * (robot.n_joints - 1), 10 * robot.n_joints)
    names = robot.link_parameters[own]
    carriers = [name for name in names if name in robot.present and name not in robot.ties]
    free = np.array([
        [float(robot.ties.get(name, name) == carrier and name in robot.present)
         for carrier in carriers] for name in names
    ]).reshape(10, len(carriers))  # fmt: skip
    K = base_parameters(robot).matrix[:, own]
    # coefficients up to 1e-9 are rounding errors of K
    free = free[:, np.abs(K @ free).max(axis=0, initial=0.0) > 1e-9]
    if not free.size:
        raise NoLoad(
            f"{robot.name}: no parameter of the last link is present in the robot file, so a "
            "load cannot be found; add m, sx, sy, sz and inertias to its parameters"
        )
    absent = zip(LINK_PARAMETERS, names, strict=True)
    return LoadColumns(K, free, tuple(short for short, name in absent if name not in robot.present))
