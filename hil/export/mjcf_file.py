"""Model as an MJCF file of MuJoCo: bodies, rotors, damping, friction, limits and motors.

Rotor inertias become the armature of the joints. If a motor turns with two joints, its share of the
mass matrix is not diagonal. Fixed tendons with armature then represent this share, one for each
column of its Cholesky factor. The offset of a friction law becomes the bias of the joint's
actuator. The file needs none of MuJoCo's repairs: inertias are positive definite and meet the
triangle inequality.

Dry friction is a constraint of MuJoCo with the reference acceleration -B v and a force of at most
`frictionloss`: the torque is -(a + B v) / R, clipped, with R = (1 - d) / d over the inertia. In
`mj_inverse` friction therefore has the sign of a + B v, and is reversed for a braking joint slower
than |a| / B. By default B is 105 1/s. Here B is 1 / timestep, the greatest value that a time step
resolves: friction stops a joint within a step and does not reverse it, and `mj_inverse` reverses
friction only in the last step before a reversal. The impedance d is 0.999, so that the
acceleration, and the friction of a slow joint, has a relative error of 0.001.

Format reference: mujoco.readthedocs.io, XML reference.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import numpy as np

from hil.export.exported import Exported
from hil.export.simple_friction import damping_remarks, friction_remarks
from hil.export.simulated_robot import comment, number, numbers, simulated_robot

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hil.arrays import Array
    from hil.export.simulated_robot import SimulatedJoint, SimulatedRobot
    from hil.export.urdf_file import Given
    from hil.results.model import Model


STEP = 0.001
"""Time step in the file [s], that of controllers at 1 kHz."""
IMPEDANCE = 0.999
"""Impedance of dry friction: share of the reference acceleration before slipping, at most 0.9999 in
MuJoCo. With the default of 0.9, a joint held by friction would creep.
"""
FULL = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def write_mjcf(model: Model, origin: tuple[str, ...], given: Given | None = None) -> Exported:
    """Return the model as `NAME.xml`, with frames and names of a URDF if given."""
    robot = simulated_robot(model, None if given is None else given.chain)
    remarks = (
        *friction_remarks(model, offsets="the bias of its actuator"),
        *damping_remarks(model),
        *_left_out(model, robot),
    )
    root = ET.Element("mujoco", model=robot.name)
    root.append(ET.Comment(comment((*origin, *remarks))))
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", gravity=numbers(robot.gravity), timestep=number(STEP))
    base = ET.SubElement(ET.SubElement(root, "worldbody"), "body", name=robot.base)
    links: list[ET.Element] = []
    for joint in robot.joints:
        parent = links[joint.parent] if joint.parent >= 0 else base
        links.append(_body(parent, joint, coupled=robot.coupled))
    if robot.coupled:
        # the motors' share of the mass matrix, H = L L': a tendon of unit armature per column;
        # 1e-12 kg m^2 make the factor exist for joints without a rotor
        tendon = ET.SubElement(root, "tendon")
        columns = np.linalg.cholesky(robot.rotors + 1e-12 * np.eye(len(robot.rotors))).T
        for number_, column in enumerate(columns, start=1):
            fixed = ET.SubElement(tendon, "fixed", name=f"rotors{number_}", armature="1")
            for joint, share in zip(robot.joints, column, strict=True):
                if share:
                    ET.SubElement(fixed, "joint", joint=joint.name, coef=number(float(share)))
    actuator = ET.SubElement(root, "actuator")
    for joint in robot.joints:
        stated = {"name": f"{joint.name}_motor", "joint": joint.name}
        if not np.isnan(joint.effort):
            stated["ctrlrange"] = numbers((-joint.effort, joint.effort))
        offset = 0.0 if joint.friction is None else joint.friction.constant
        if offset:
            # motor with the bias -offset, which compensates the law's constant torque
            stated |= {
                "gainprm": "1",
                "biastype": "affine",
                "biasprm": numbers((-offset, 0.0, 0.0)),
            }
        ET.SubElement(actuator, "general" if offset else "motor", stated)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode") + "\n"
    return Exported({f"{model.robot.name}.xml": text}, remarks)


def _body(parent: ET.Element, joint: SimulatedJoint, *, coupled: bool) -> ET.Element:
    place = {"pos": numbers(joint.before[:3, 3]), "quat": numbers(quaternion(joint.before[:3, :3]))}
    body = ET.SubElement(parent, "body", {"name": joint.link, **place})
    inertia = numbers(joint.inertia[at] for at in FULL)
    ET.SubElement(
        body, "inertial", pos=numbers(joint.centre), mass=number(joint.mass), fullinertia=inertia
    )
    stated = {
        "name": joint.name,
        "type": "hinge" if joint.revolute else "slide",
        "axis": numbers(joint.axis),
        "range": numbers((joint.lower, joint.upper)),
        "armature": number(0.0 if coupled else joint.armature),
    }
    if joint.friction is not None:
        stated["damping"] = numbers(joint.friction.damping)
        stated["frictionloss"] = number(joint.friction.coasting.coulomb)
        # stiffness and damping given directly: a time constant would be at least two steps
        stated["solreffriction"] = numbers((0.0, -IMPEDANCE / STEP))
        stated["solimpfriction"] = numbers((IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0))
    if joint.stiffness:
        stated["stiffness"] = number(joint.stiffness)
    ET.SubElement(body, "joint", stated)
    return body


def quaternion(rotation: Array) -> Array:
    """Return the quaternion of a rotation in MuJoCo's order, w x y z."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - takes long to load

    return np.roll(Rotation.from_matrix(rotation).as_quat(), 1)


def _left_out(model: Model, robot: SimulatedRobot) -> Iterator[str]:
    if any(joint.friction is not None for joint in robot.joints):
        yield (
            "in mj_inverse friction changes sign too early while a joint brakes with "
            f"acceleration a [rad/s2 or m/s2]: at {number(STEP)} a [rad/s or m/s]; for another "
            f"timestep set each solreffriction to {number(-IMPEDANCE)} / timestep"
        )
    springs = [name for name in model.robot.added_parameters if name.startswith(("kc", "ks"))]
    if springs:
        yield f"counterbalances {', '.join(springs)} are left out: MJCF has linear springs"
    if any(joint.stiffness for joint in robot.joints):
        yield "springs are assumed slack at q = 0"
