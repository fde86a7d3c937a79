"""A URDF that a model is exported into, the chain of it that has the model's frames, its bodies.

Identified is what moves with a joint, whatever it is bolted together from. So the body of a link
of the chain is that of all links attached to it, and the others of them have none left.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hil.errors import Mismatch
from hil.export.simulated_robot import likely_of
from hil.model.frames import parameter_map
from hil.model.readers.axes_to_frames import difference
from hil.model.readers.urdf import MOVING, UrdfChain, UrdfReader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.model.robot import Robot


INERTIA = {f"i{'xyz'[i]}{'xyz'[j]}": (i, j) for i, j in zip(*np.triu_indices(3), strict=True)}
"""Attributes of an <inertia>, in the order of standard parameters, and their places."""


class Given(NamedTuple):
    """A URDF as it is read, and the chain in it."""

    path: Path
    reader: UrdfReader
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
    reader = UrdfReader(path := Path(path))
    whys = ["it has fewer joints that move in a row"]
    chains = _chains(reader, robot.n_joints)
    for chain in sorted(chains, key=lambda each: np.array_equal(each.revolute, robot.revolute)):
        found = difference(chain, robot)
        if not found:
            return Given(path, reader, chain)
        whys.append(f"from {chain.base} to {chain.tip} {found}")
    raise Mismatch(
        f"{path}: no chain of {robot.n_joints} joints has the frames of {robot.name}: {whys[-1]};"
        " give the URDF that the robot was made from, or leave it out"
    )


def bodies_of(given: Given, robot: Robot) -> Array | None:
    """Bodies that the URDF states for the links of a robot, shape (n_joints, 10), or None.

    Raises
    ------
    FileError
        An inertial without numbers.
    """
    stated = [body_of(given.reader, joint.link) for joint in given.chain.joints]
    return likely_of(given.chain, robot, stated)


def body_of(reader: UrdfReader, link: str) -> Array | None:
    """Standard parameters of all attached links in a link's frame; None where none has any.

    Raises
    ------
    FileError
        An inertial without numbers.
    """
    parts = [(_inertial(reader, name), pose) for name, pose in reader.attached(link, np.eye(4))]
    known = [parameter_map(pose) @ body for body, pose in parts if body is not None]
    return np.sum(known, axis=0) if known else None


def _inertial(reader: UrdfReader, link: str) -> Array | None:
    element = reader.links[link].find("inertial")
    mass, inertia = (None if element is None else element.find(tag) for tag in ("mass", "inertia"))
    if element is None or mass is None or inertia is None:
        return None
    (m,) = reader.file.numbers(mass, "value", 1) or [0.0]
    own = [(reader.file.numbers(inertia, key, 1) or [0.0])[0] for key in INERTIA]
    about_centre = np.array([*own, 0.0, 0.0, 0.0, m])
    return np.asarray(parameter_map(reader.origin(element)) @ about_centre)


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
