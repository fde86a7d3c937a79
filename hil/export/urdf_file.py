"""Model as a URDF, new or updated: inertials, limits, damping and friction of the joints.

Without a URDF of the robot a new one is made, of links and joints alone. With a URDF, the chain
with the model's frames is found. Everything in the file stays unchanged, shapes and meshes, limits
and names, except the inertials and the dynamics of the chain. An identified body includes all parts
that move with a joint. Therefore the link of the chain gets the body of all links attached to it,
and the attached links lose their inertials.

A URDF has no rotor inertia and no gravity: the file states both in comments. If gravity of the
robot file is not along -z, a fixed joint turns the base until gravity is along -z.

Format reference: wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from checked_files.yaml_file import FileError
from hil.errors import Mismatch
from hil.estimation.consistent.conditions import MOST_MASS, largest_radius
from hil.export.exported import Exported
from hil.export.simple_friction import friction_remarks
from hil.export.simulated_robot import (
    comment,
    moved_to_frames,
    number,
    numbers,
    roll_pitch_yaw,
    simulated_robot,
)
from hil.model.frames import parameter_map, pseudo_inertia
from hil.model.readers.axes_to_frames import difference
from hil.model.readers.urdf import MOVING, UrdfChain, UrdfReader

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.export.simulated_robot import SimulatedJoint, SimulatedRobot
    from hil.model.robot import Robot
    from hil.results.model import Model

INERTIA = {f"i{'xyz'[i]}{'xyz'[j]}": (i, j) for i, j in zip(*np.triu_indices(3), strict=True)}
"""Attributes of an <inertia>, in the order of standard parameters, with their indices."""
NO_CHAIN = "the longest chain has fewer moving joints"
NO_TREE = "a tree is found by the names of its joints, and the file lacks some"
_ROUNDED = 1e-5
"""Tolerance for rounding, relative to the greatest moment; exporters write six digits."""


class Given(NamedTuple):
    """URDF reader with the robot's chain."""

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
        No chain has the frames of the robot.
    """
    reader = UrdfReader(path := Path(path))
    whys = [NO_CHAIN if robot.is_chain else NO_TREE]
    chains = _chains(reader, robot)
    for chain in sorted(chains, key=lambda each: np.array_equal(each.revolute, robot.revolute)):
        found = difference(chain, robot)
        if not found:
            return Given(path, reader, chain)
        whys.append(f"from {chain.base} to {chain.tip} {found}")
    raise Mismatch(
        f"{path}: no chain of {robot.n_joints} joints has the frames of {robot.name}: "
        f"{whys[-1]}; give the URDF of the robot file, or none"
    )


def bodies_of(given: Given, robot: Robot) -> Array | None:
    """Return the robot's bodies according to the URDF, shape (n_joints, 10), or None.

    None if a link has no body or a physically impossible one (`inertial_faults`).
    """
    if any(inertial_faults(given, robot)):
        return None
    stated = [body_of(given.reader, joint.link) for joint in given.chain.joints]
    return moved_to_frames(given.chain, robot, [body for body in stated if body is not None])


def inertial_faults(given: Given, robot: Robot) -> Iterator[str]:
    """Yield the faults of the inertials of a robot's links, each with file, line and link.

    Bodies have a positive mass, and positive principal moments of inertia, the greatest less than
    the sum of the other two. Size and mass are within `BodyBounds`, so that g mm^2 for kg m^2 and g
    for kg are detected.
    """
    radius = largest_radius(robot)
    for joint in given.chain.joints:
        links = [name for name, _ in given.reader.find_attached(joint.link, np.eye(4))]
        faults = [fault for name in links for fault in _link_faults(given.reader, name)]
        yield from faults
        if faults:
            continue
        body = body_of(given.reader, joint.link)
        also = f" and {', '.join(links[1:])} (fixed to it)" if links[1:] else ""
        if body is None or not body[9]:
            none = f"{also} {'have' if also else 'has'} no <inertial> with a mass"
            yield _fault(given.reader, joint.link, f"{none}: add mass and inertia from CAD")
            continue
        spread = pseudo_inertia(body)
        mass, wide = spread[3, 3], float(np.trace(spread[:3, :3]))
        what = ""
        if np.linalg.eigvalsh(spread)[0] <= 0:
            what = (
                "the greatest principal moment of inertia must be less than the sum of the other "
                "two: the body has no thickness; correct ixx to izz"
            )
        elif (far := float(np.sqrt(wide / mass))) > radius:
            what = (
                f"mass and inertia give a radius of gyration of {far:.3g} m, at most "
                f"{radius:.3g} m allowed; state kg and kg m2, not g mm2, and <origin> in m"
            )
        elif mass > MOST_MASS:
            what = f"mass {mass:g} kg must be at most {MOST_MASS:g} kg; state kg, not g"
        if what:
            yield _fault(given.reader, joint.link, f"{also}: {what}")


def _link_faults(reader: UrdfReader, link: str) -> Iterator[str]:
    """Yield the faults of a link's own inertial; a missing inertial is no fault."""
    element = reader.links[link].find("inertial")
    if element is None:
        return
    mass, stated = element.find("mass"), element.find("inertia")
    if mass is None or stated is None:
        missing = [f"<{tag}>" for tag in ("mass", "inertia") if element.find(tag) is None]
        yield _fault(reader, link, f": its inertial has no {' and no '.join(missing)}; add it")
        return
    try:
        m, inertia = _mass_and_inertia(reader, mass, stated)
    except FileError as error:
        yield f"{error} (link {link!r})"
        return
    moments = np.linalg.eigvalsh(inertia)
    rounded = _ROUNDED * np.abs(moments).max()
    shown = ", ".join(f"{moment:.3g}" for moment in moments)
    if m < 0 or (not m and moments.any()):
        yield _fault(reader, link, f": mass {m:g} kg must be positive")
    elif moments[0] < -rounded:
        what = f": principal moments of inertia {shown} kg m2 must be positive; correct ixx to izz"
        yield _fault(reader, link, what)
    elif moments[2] - moments[1] - moments[0] > rounded:
        what = f": the greatest of the principal moments of inertia {shown} kg m2 must be at most"
        rule = "the sum of the other two (triangle inequality); correct ixx to izz"
        yield _fault(reader, link, f"{what} {rule}")


def _fault(reader: UrdfReader, link: str, what: str) -> str:
    element, inertial = reader.links[link], reader.links[link].find("inertial")
    return str(reader.file.wrong(element if inertial is None else inertial, f"link {link!r}{what}"))


def body_of(reader: UrdfReader, link: str) -> Array | None:
    """Return the sum of the bodies of attached links in a link's frame; None without any.

    Raises
    ------
    FileError
        An inertial without numbers.
    """
    parts = [
        (stated_body(reader, name), pose) for name, pose in reader.find_attached(link, np.eye(4))
    ]
    known = [parameter_map(pose) @ body for body, pose in parts if body is not None]
    return np.sum(known, axis=0) if known else None


def stated_body(reader: UrdfReader, link: str) -> Array | None:
    """Return the standard parameters of a link alone, in its frame; None without inertial."""
    element = reader.links[link].find("inertial")
    if element is None:
        return None
    mass, stated = element.find("mass"), element.find("inertia")
    if mass is None or stated is None:
        return None
    m, inertia = _mass_and_inertia(reader, mass, stated)
    about_centre = np.array([*(inertia[at] for at in INERTIA.values()), 0.0, 0.0, 0.0, m])
    return np.asarray(parameter_map(reader.origin(element)) @ about_centre)


def _mass_and_inertia(
    reader: UrdfReader, mass: ET.Element, stated: ET.Element
) -> tuple[float, Array]:
    """Return an inertial's mass [kg] and inertia about its centre, shape (3, 3) [kg m^2]."""
    (m,) = reader.file.numbers(mass, "value", 1) or [0.0]
    inertia = np.zeros((3, 3))
    for key, (i, j) in INERTIA.items():
        inertia[i, j] = inertia[j, i] = (reader.file.numbers(stated, key, 1) or [0.0])[0]
    return m, inertia


def _chains(reader: UrdfReader, robot: Robot) -> Iterator[UrdfChain]:
    """Yield all chains of as many moving joints that start and end with a moving joint.

    A tree is found by the names of its joints.
    """
    if not robot.is_chain:
        moved = reader.tips_of(robot)
        if len(moved) == robot.n_joints:
            yield reader.chain(None, moved)
        return
    n_joints = robot.n_joints
    for tip in reader.links:
        here, moving = tip, 0
        while moving < n_joints and here in reader.above:
            edge = reader.above[here]
            turns = edge.element.get("type") in MOVING and edge.element.find("mimic") is None
            if not turns and (here == tip or edge.element.get("type") != "fixed"):
                break
            here, moving = edge.parent, moving + turns
        if moving == n_joints:
            yield reader.chain(here, [tip])


UNLIMITED = 1e6
"""Value for an unknown effort or velocity limit."""


def write_urdf(model: Model, origin: tuple[str, ...], given: Given | None = None) -> Exported:
    """Return the model as a new URDF, or as an update of the given one."""
    robot = simulated_robot(model, None if given is None else given.chain)
    root, more = _own(robot) if given is None else _update(robot, given)
    remarks = (*urdf_remarks(model, robot), *more)
    root.insert(0, ET.Comment(comment((*origin, *remarks))))
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    return Exported({f"{model.robot.name}.urdf": text}, remarks)


def _own(robot: SimulatedRobot) -> tuple[ET.Element, list[str]]:
    """Return a URDF of links and joints alone, and remarks on it."""
    root = ET.Element("robot", name=robot.name)
    ET.SubElement(root, "link", name=robot.base)
    turned = None
    size = float(np.linalg.norm(robot.gravity))
    if size and not np.allclose(robot.gravity / size, [0.0, 0.0, -1.0], atol=1e-12):
        # the rotation of the base that turns gravity to -z
        z = -robot.gravity / size
        x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
        x = x / np.linalg.norm(x)
        turned = np.array([x, np.cross(z, x), z])
    if turned is not None:
        root.insert(0, ET.Element("link", name="world"))
        _joint(root, "world_to_base", "fixed", ("world", robot.base), turned, np.zeros(3))
    for joint in robot.joints:
        parent = robot.joints[joint.parent].link if joint.parent >= 0 else robot.base
        link = ET.SubElement(root, "link", name=joint.link)
        link.append(_inertial(joint))
        kind = "revolute" if joint.revolute else "prismatic"
        place = joint.before[:3, :3], joint.before[:3, 3]
        made = _joint(root, joint.name, kind, (parent, joint.link), *place)
        ET.SubElement(made, "axis", xyz=numbers(joint.axis))
        limits = {"lower": joint.lower, "upper": joint.upper}
        limits |= {"effort": joint.effort, "velocity": joint.velocity}
        # a URDF must state all of them
        stated = {k: number(UNLIMITED if np.isnan(x) else x) for k, x in limits.items()}
        ET.SubElement(made, "limit", stated)
        _set_dynamics(made, joint)
    unknown = [joint.name for joint in robot.joints if np.isnan(joint.effort + joint.velocity)]
    said = (
        f"effort or velocity of {', '.join(unknown)} is unknown; {UNLIMITED:g} is written instead"
    )
    return root, [said] if unknown else []


def _joint(
    root: ET.Element, name: str, kind: str, ends: tuple[str, str], rotation: Array, position: Array
) -> ET.Element:
    made = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(made, "parent", link=ends[0])
    ET.SubElement(made, "child", link=ends[1])
    angles = numbers(roll_pitch_yaw(rotation))
    ET.SubElement(made, "origin", xyz=numbers(position), rpy=angles)
    return made


def _update(robot: SimulatedRobot, given: Given) -> tuple[ET.Element, list[str]]:
    """Return the given URDF with the robot's bodies and dynamics, and remarks on it."""
    builder = ET.TreeBuilder(insert_comments=True)
    parser = ET.XMLParser(target=builder)  # noqa: S314 - its reader has refused entities
    root = ET.parse(given.path, parser).getroot()  # noqa: S314 - as above
    of_name = {each.get("name"): each for each in root.iter("link")}
    joints = {each.get("name"): each for each in root.findall("joint")}
    chain, remarks = {joint.name for joint in robot.joints}, []
    for joint in robot.joints:
        attached = [name for name, _ in given.reader.find_attached(joint.link, np.eye(4))]
        for name in attached:
            for old in of_name[name].findall("inertial"):
                of_name[name].remove(old)
        of_name[joint.link].insert(0, _inertial(joint))
        _set_dynamics(joints[joint.name], joint)
        if attached[1:]:
            remarks.append(f"the inertial of {joint.link} includes {', '.join(attached[1:])}")
        below = (edge.element for name in attached for edge in given.reader.below.get(name, ()))
        others = [str(e.get("name")) for e in below if e.get("type") != "fixed"]
        others = [name for name in others if name not in chain]
        if others:
            remarks.append(
                f"joints {', '.join(others)}: remove the inertials of links mounted during "
                f"measurement; {joint.link} already includes these links"
            )
    return root, remarks


def _inertial(joint: SimulatedJoint) -> ET.Element:
    made = ET.Element("inertial")
    ET.SubElement(made, "origin", xyz=numbers(joint.centre), rpy="0 0 0")
    ET.SubElement(made, "mass", value=number(joint.mass))
    inertia = joint.inertia
    ET.SubElement(made, "inertia", {key: number(inertia[at]) for key, at in INERTIA.items()})
    return made


def _set_dynamics(element: ET.Element, joint: SimulatedJoint) -> None:
    for old in element.findall("dynamics"):
        element.remove(old)
    if joint.friction is not None:
        friction = {"damping": joint.friction.viscous, "friction": joint.friction.coulomb}
        ET.SubElement(element, "dynamics", {k: number(x) for k, x in friction.items()})


def urdf_remarks(model: Model, robot: SimulatedRobot) -> Iterator[str]:
    """Yield remarks: quantities missing in a URDF, or to be set separately in the simulator."""
    if robot.rotors.any():
        each = ", ".join(f"{joint.name} {joint.armature:.6g}" for joint in robot.joints)
        yield (
            "a URDF has no rotor inertia: set it in the simulator as armature, on the joint side "
            f"[kg m2 or kg]: {each}"
        )
    if robot.coupled:
        yield f"motors turn with two joints; inertia matrix of the motors: {robot.rotors.tolist()}"
    size = float(np.linalg.norm(robot.gravity))
    if abs(size - 9.81) >= 1e-9:
        yield (
            f"identified with gravity of {number(size)} m/s2: set the same gravity in the simulator"
        )
    springs = [name for name in model.robot.added_parameters if name.startswith("k")]
    if springs:
        yield f"a URDF has no springs: {', '.join(springs)} are left out"
    yield from friction_remarks(model)
