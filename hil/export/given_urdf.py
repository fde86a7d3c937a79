"""A URDF that a model is exported into."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hil.export.simulated_robot import likely_of
from hil.export.urdf_links import UrdfLinks
from hil.model.urdf import UrdfChain, read_urdf

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from hil.model.robot import Robot


class Given(NamedTuple):
    """A URDF and the chain in it."""

    path: Path
    chain: UrdfChain


def given_urdf(path: Path, base: str | None = None, tip: str | None = None) -> Given:
    """Read a URDF and its chain; errors as of `hil.model.urdf.read_urdf`."""
    return Given(path, read_urdf(path, base, tip))


def bodies_of(given: Given, robot: Robot) -> NDArray[np.float64] | None:
    """Bodies that the URDF states for the links of a robot, shape (n_joints, 10), or None.

    Raises
    ------
    Mismatch
        The URDF's chain is another one than the robot's.
    FileError
        An inertial without numbers.
    """
    links = UrdfLinks(given.path)
    return likely_of(given.chain, robot, [links.body(joint.link) for joint in given.chain.joints])
