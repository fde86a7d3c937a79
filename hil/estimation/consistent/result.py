"""The nearest robot that consists of bodies, as `model.yaml` keeps it beside the estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT

if TYPE_CHECKING:
    from hil.arrays import Array


class LinkBody(FileModel):
    """One link.

    Attributes
    ----------
    parameters : tuple of ten floats
        Inertia about the origin of the link's frame (xx, xy, xz, yy, yz, zz), first moment, mass
        [kg m^2, kg m, kg].
    thickness : float
        Least spread of its mass about the centre, root mean square [m].
    """

    parameters: tuple[float, ...]
    thickness: float


class BindingCondition(FileModel):
    """A condition that the estimate does not meet, and the distance without this one."""

    name: str
    distance_without: float


class TorqueCost(FileModel):
    """What the change means in torques of one axis over the run's motions [N m or N].

    Attributes
    ----------
    change : float
        Root mean square of the torques' change.
    standard_error : float
        Root mean square of the standard error of the torques that the estimate predicts.
    torque : float
        Root mean square of these torques themselves.
    """

    change: float
    standard_error: float
    torque: float


class ConsistentRobot(FileModel):
    """Bodies, base parameters that they have, and what these cost.

    Attributes
    ----------
    values : tuple of float
        Base parameters p' of the bodies.
    change : tuple of float
        Of each from the estimate, in standard errors.
    distance : float
        d^2, in the metric of the estimate's covariance: a chi-square.
    degrees_of_freedom : int
        Of the chi-square that d^2 is compared with (`hil.estimation.consistent.nearest`).
    p_value : float
        Greatest chance of so great a distance of an estimate of bodies.
    distance_complete : float
        The distance if link parameters that the robot file leaves out could have any value.
    thickness : float
        Least spread that was asked for [m].
    masses : dict of int to (float, float)
        Bounds of masses that were asked for, by link from 1 [kg].
    likely : str
        Where the likely bodies come from, to which those here are nearest where no torque decides.
    open_masses : tuple of int
        Links, from 1, whose mass no torque decides.
    links : tuple of LinkBody
    added : dict of str to float
        Rotor inertias and springs, by name (`hil.model.added_parameters`).
    binding : tuple of BindingCondition
        Those that cost most first.
    torque : tuple of TorqueCost
        Axis by axis; empty where no motion was at hand.
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
        """Whether the data contradict these bodies beyond chance."""
        return self.p_value < SIGNIFICANT
