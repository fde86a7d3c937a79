"""A URDF that a model is exported into, and the chain of it that has the model's frames."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import Mismatch
from hil.export.simulated_robot import likely_of
from hil.export.urdf_links import UrdfLinks
from hil.model.readers.axes_to_frames import difference
from hil.model.readers.urdf import MOVING, UrdfChain, UrdfReader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from hil.model.robot import Robot


class Given(NamedTuple):
    """A URDF and the chain in it."""

    path: Path
    chain: UrdfChain


def given_urdf(path: Path | str, robot: Robot) -> Given:
    """Read a URDF and find the chain of a robot in it.

    Raises
    ------
    FileError
        No URDF.
    Mismatch
        No chain of it has the frames of the robot.
    """
    path = Path(path)
    whys = ["it has fewer joints that move in a row"]
    chains = _chains(UrdfReader(path), robot.n_joints)
    for chain in sorted(chains, key=lambda each: np.array_equal(each.revolute, robot.revolute)):
        found = difference(chain, robot)
        if not found:
            return Given(path, chain)
        whys.append(f"from {chain.base} to {chain.tip} {found}")
    raise Mismatch(
        f"{path}: no chain of {robot.n_joints} joints has the frames of {robot.name}: {whys[-1]};"
        " give the URDF that the robot was made from, or leave it out"
    )


def bodies_of(given: Given, robot: Robot) -> NDArray[np.float64] | None:
    """Bodies that the URDF states for the links of a robot, shape (n_joints, 10), or None.

    Raises
    ------
    FileError
        An inertial without numbers.
    """
    links = UrdfLinks(given.path)
    return likely_of(given.chain, robot, [links.body(joint.link) for joint in given.chain.joints])


def _chains(reader: UrdfReader, n_joints: int) -> Iterator[UrdfChain]:
    """Every chain of so many joints that move, which begins and ends with one."""
    for tip in reader.links:
        here, moving = tip, 0
        while moving < n_joints and here in reader.above:
            edge = reader.above[here]
            turns = edge.element.get("type") in MOVING and edge.element.find("mimic") is None
            if not turns and (here == tip or edge.element.get("type") != "fixed"):
                break
            here, moving = edge.parent, moving + turns
        if moving == n_joints:
            yield reader.chain(here, tip)
