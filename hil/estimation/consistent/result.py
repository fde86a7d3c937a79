"""Nearest robot of physical bodies, as stored beside the estimate in `model.yaml`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT

if TYPE_CHECKING:
    from hil.arrays import Array


class LinkBody(FileModel):
    """Physical body of a link: parameters and thickness.

    Attributes
    ----------
    parameters : tuple of ten floats
        Inertia about the origin of the link's frame (xx, xy, xz, yy, yz, zz), first moment, mass
        [kg m^2, kg m, kg].
    thickness : float
        Least root-mean-square spread of the mass about the centre [m].
    """

    parameters: tuple[float, ...]
    thickness: float


class BindingCondition(FileModel):
    """Condition that the estimate violates, and the distance without the condition."""

    name: str
    distance_without: float


class TorqueCost(FileModel):
    """Change of an axis's torque over the motions of a run, due to the conditions [N m or N].

    Attributes
    ----------
    change : float
        Root mean square of the change.
    standard_error : float
        Root mean square of the standard error of the predicted torque.
    torque : float
        Root mean square of the predicted torque.
    """

    change: float
    standard_error: float
    torque: float


class ConsistentRobot(FileModel):
    """Physical bodies, their base parameters, and the distance from the estimate.

    Attributes
    ----------
    values : tuple of float
        Base parameters p' of the bodies.
    change : tuple of float
        Change of each parameter from the estimate, in standard errors.
    distance : float
        d^2, in the metric of the estimate's covariance: a chi-square.
    degrees_of_freedom : int
        Degrees of freedom of the chi-square for d^2 (`hil.estimation.consistent.nearest`).
    p_value : float
        Greatest probability of such a distance if the true parameters are bodies.
    distance_complete : float
        Distance if link parameters left out of the robot file could have any value.
    thickness : float
        Demanded minimum spread [m].
    masses : dict of int to (float, float)
        Demanded bounds of masses, by link from 1 [kg].
    likely : str
        Source of the likely bodies, which decide what torques do not determine.
    open_masses : tuple of int
        Links, from 1, with a mass that no torque determines.
    added : dict of str to float
        Rotor inertias and springs, by name (`hil.model.added_parameters`).
    binding : tuple of BindingCondition
        Most costly conditions first.
    torque : tuple of TorqueCost
        By axis; empty without motions.
    """

    values: tuple[float, ...]
    change: tuple[float, ...]
    distance: float
    degrees_of_freedom: int
    p_value: float
    distance_complete: float
    thickness: float
    masses: dict[int, tuple[float, float]]
    likely: str
    open_masses: tuple[int, ...]
    links: tuple[LinkBody, ...]
    added: dict[str, float]
    binding: tuple[BindingCondition, ...]
    torque: tuple[TorqueCost, ...] = ()

    @property
    def p(self) -> Array:
        """Base parameters, shape (n_base,)."""
        return np.array(self.values)

    @property
    def bodies(self) -> Array:
        """Standard parameters of the links, shape (n_joints, 10)."""
        return np.array([link.parameters for link in self.links])

    @property
    def contradicted(self) -> bool:
        """True if the data contradict these bodies significantly."""
        return self.p_value < SIGNIFICANT
