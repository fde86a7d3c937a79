"""The nearest robot that consists of bodies, as `model.yaml` keeps it beside the estimate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from checked_files.yaml_file import FileModel
from hil.estimation.intervals import SIGNIFICANT
from hil.model.base_parameters import base_parameters
from hil.results.rounding import probability

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot


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
        Base parameters.
    change : tuple of float
        Of each from the estimate, in standard errors.
    distance : float
        Squared, in the metric of the estimate's covariance: a chi-square.
    degrees_of_freedom : int
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
        Rotor inertias and springs, by name.
    binding : tuple of BindingCondition
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

    def statements(self, robot: Robot) -> tuple[str, ...]:
        """Distance, what binds and what it costs, in sentences."""
        return tuple(self._statements(robot))

    def _statements(self, robot: Robot) -> Iterator[str]:
        if not self.binding:
            yield (
                "the identified base parameters belong to bodies as they are: distance 0, no"
                " condition binds"
            )
        else:
            yield from self._distance(robot)
        if self.open_masses:
            links = ", ".join(map(str, self.open_masses))
            yield (
                f"no torque decides the masses of links {links}: they come from {self.likely}, and"
                " centres and inertias of these links go with them"
            )
        if self.binding and self.contradicted:
            yield (
                "the data contradict bodies: look for what the model leaves out (hil diagnose), for"
                " torque constants and rotor inertias that are stated wrongly, or export nothing"
            )

    def _distance(self, robot: Robot) -> Iterator[str]:
        names, order = base_parameters(robot).names, np.argsort(-np.abs(self.change))[:3]
        binding = [f"{each.name} (without it {each.distance_without:.4g})" for each in self.binding]
        moved = [f"{names[k]} by {self.change[k]:+.3g}" for k in order if abs(self.change[k]) > 0.1]
        costs = [
            f"axis {axis + 1} {each.change:.2g} {robot.torque_unit(axis)} (standard error"
            f" {each.standard_error:.2g}, torque {each.torque:.3g})"
            for axis, each in enumerate(self.torque)
        ]
        yield (
            f"nearest robot that consists of bodies: distance {self.distance:.4g}, a chi-square of"
            f" at most {self.degrees_of_freedom} degrees of freedom, p {probability(self.p_value)};"
            f" {self.distance_complete:.4g} if the robot file left no link parameter out"
        )
        yield f"conditions that bind: {', '.join(binding)}"
        if moved:
            yield f"moved most, in standard errors: {', '.join(moved)}"
        if costs:
            yield f"torques change, rms over the run's motions: {'; '.join(costs)}"
