"""A model as an MJCF file of MuJoCo: bodies, rotors, damping, friction, limits and motors.

Rotor inertias are the joints' armature. Where a motor turns with two joints its share of the mass
matrix is not diagonal; then fixed tendons with armature carry it, one for each column of its
Cholesky factor. The file needs none of MuJoCo's repairs: inertias are positive definite and meet
the triangle inequality.

Dry friction is a constraint of MuJoCo, which asks for the acceleration -B v and gives up to
`frictionloss` for it: the torque -(a + B v) / R, clipped, with R = (1 - d) / d over the inertia. In
`mj_inverse` friction therefore has the sign of a + B v, and is reversed where a joint that brakes
is slower than |a| / B. By default B is 105 1/s. Here B is 1 / timestep, the greatest that a step of
the simulation follows: friction stops a joint within a step and does not reverse it, and
`mj_inverse` reverses friction in the last step before a reversal alone. The impedance d is
0.999, so that the acceleration, and a slow joint's friction, is right but for 0.001 of it.

The format: mujoco.readthedocs.io, XML reference.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from hil.export.exported import Exported
from hil.export.simple_friction import friction_remarks
from hil.export.simulated_robot import comment, number, numbers, simulated_robot

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.export.simulated_robot import SimulatedJoint, SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.results.model import Model


STEP = 0.001
"""Time step that the file states [s]: of controllers at 1 kHz."""
IMPEDANCE = 0.999
"""Share of the wanted acceleration that dry friction reaches before it slips; MuJoCo allows 0.9999,
and 0.9 by default leaves a tenth: a joint that friction holds would creep."""
FULL = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def write_mjcf(model: Model, origin: tuple[str, ...], given: Given | None = None) -> Exported:
    """Return the model as `NAME.xml`; in frames and with names of a URDF where given."""
    robot = simulated_robot(model, None if given is None else given.chain)
    remarks = (*friction_remarks(model), *_left_out(model, robot))
    root = ET.Element("mujoco", model=robot.name)
    root.append(ET.Comment(comment((*origin, *remarks))))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=numbers(robot.gravity), timestep=number(STEP))
    parent = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=robot.base)
    for joint in robot.joints:
        parent = _body(parent, joint, coupled=robot.coupled)
    if robot.coupled:
        _tendons(root, robot)
    _motors(root, robot)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode") + "\n"
    return Exported({f"{model.robot.name}.xml": text}, remarks)


def _body(parent: ET.Element, joint: SimulatedJoint, *, coupled: bool) -> ET.Element:
    place = {"pos": numbers(joint.before[:3, 3]), "quat": numbers(quaternion(joint.before[:3, :3]))}
    body = ET.SubElement(parent, "body", {"name": joint.link, **place})
    inertia = numbers(joint.inertia[at] for at in FULL)
    ET.SubElement(
        body,
        "inertial",
        pos=numbers(joint.centre),
        mass=number(joint.mass),
        fullinertia=inertia,
    )
    stated = {
        "name": joint.name,
        "type": "hinge" if joint.revolute else "slide",
        "axis": numbers(joint.axis),
        "range": numbers((joint.lower, joint.upper)),
        "armature": number(0.0 if coupled else joint.armature),
    }
    if joint.friction is not None:
        stated["damping"] = number(joint.friction.viscous)
        stated["frictionloss"] = number(joint.friction.coulomb)
        # stiffness and damping as such: a time constant would be at least two steps
        stated["solreffriction"] = numbers((0.0, -IMPEDANCE / STEP))
        stated["solimpfriction"] = numbers((IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0))
    if joint.stiffness:
        stated["stiffness"] = number(joint.stiffness)
    ET.SubElement(body, "joint", stated)
    return body


def quaternion(rotation: Array) -> Array:
    """Quaternion of a rotation as MuJoCo orders it, w x y z."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - takes long to load

    return np.roll(Rotation.from_matrix(rotation).as_quat(), 1)


def _tendons(root: ET.Element, robot: SimulatedRobot) -> None:
    """Motors' share of the mass matrix, H = L L': a tendon of unit armature for each column.

    1e-12 kg m^2 more make the factor of joints without any rotor exist.
    """
    tendon = ET.SubElement(root, "tendon")
    columns = np.linalg.cholesky(robot.rotors + 1e-12 * np.eye(len(robot.rotors))).T
    for number_, column in enumerate(columns, start=1):
        fixed = ET.SubElement(tendon, "fixed", name=f"rotors{number_}", armature="1")
        for joint, share in zip(robot.joints, column, strict=True):
            if share:
                ET.SubElement(fixed, "joint", joint=joint.name, coef=number(float(share)))


def _motors(root: ET.Element, robot: SimulatedRobot) -> None:
    actuator = ET.SubElement(root, "actuator")
    for joint in robot.joints:
        stated = {"name": f"{joint.name}_motor", "joint": joint.name}
        if not np.isnan(joint.effort):
            stated["ctrlrange"] = numbers((-joint.effort, joint.effort))
        ET.SubElement(actuator, "motor", stated)


def _left_out(model: Model, robot: SimulatedRobot) -> Iterator[str]:
    if any(joint.friction is not None for joint in robot.joints):
        yield (
            f"mj_inverse reverses the friction of a joint that brakes with a [rad/s2 or m/s2] below"
            f" {number(STEP)} a [rad/s or m/s]; with another timestep set each solreffriction to"
            f" {number(-IMPEDANCE)} over it"
        )
    springs = [name for name in model.robot.added_parameters if name.startswith(("kc", "ks"))]
    if springs:
        yield f"counterbalances {', '.join(springs)} are left out: MJCF has linear springs"
    if any(joint.stiffness for joint in robot.joints):
        yield "springs are taken for slack at q = 0"
