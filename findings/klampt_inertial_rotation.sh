#!/usr/bin/env bash
# Klampt 0.10.1.post1: the rotation of an inertial frame in a URDF is applied
# backwards.
#
# Input: a rod in a URDF, tilted by 30 degrees in the frame of its link: inertia
# 0.01 kg m^2 about its own axis and 0.50 across, in the axes of the rod, with
# <origin rpy="0 pi/6 0"/>; then tilted by -30 and by 90 degrees.
#
# Expected: the tensor of the rod, rotated into the axes of the link, as the
# specification of URDF says and as Pinocchio computes.
#
# Seen: 30 degrees to one side become 30 degrees to the other side. The moments of
# inertia, mass, centre of mass and gravity torque are right; the products of
# inertia have the wrong sign. An acceleration of one axis thus pushes the other
# to the wrong side: the mass matrix has +0.21 instead of -0.21 kg m^2 between two
# axes. With a rotation by 90 degrees about one axis the result is right, so the usual
# check passes. With three angles the moments are wrong as well.
#
# Documentation: the class Mass says that its inertia matrix "is specified in the local
# frame of the object and centered at the center of mass"; loadRobot: "Loads a robot
# from a .rob or .urdf file".
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check klampt==0.10.1.post1 pin==4.1.0 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF' | grep -v "^URDFParser\|^WorldModel"
import sys

import klampt
import numpy as np
import pinocchio as pin

URDF = """
<robot name="rod">
  <link name="base">
    <inertial>
      <mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="pan">
    <inertial>
      <mass value="0.001"/>
      <inertia ixx="0.00001" iyy="0.00001" izz="0.00001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="rod">
    <inertial>
      <origin xyz="0.2 0 0" rpy="{rpy}"/>
      <mass value="1"/>
      <inertia ixx="0.5" iyy="0.5" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="first" type="revolute">
    <parent link="base"/>
    <child link="pan"/>
    <origin xyz="0 0 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
  <joint name="second" type="revolute">
    <parent link="pan"/>
    <child link="rod"/>
    <origin xyz="0 0 0"/>
    <axis xyz="1 0 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
</robot>
"""


def load(*rpy):
    """Return tensor of the rod, mass matrix and gravity torques of both readers."""
    text = URDF.format(rpy=" ".join(str(np.radians(angle)) for angle in rpy))
    with open("rod.urdf", "w") as file:
        file.write(text)
    world = klampt.WorldModel()
    assert world.readFile("rod.urdf")
    robot = world.robot(0)
    # the last two links are the two axes; the others place the base
    robot.setConfig([0.0] * robot.numLinks())
    tensor = np.reshape(robot.link("rod").getMass().getInertia(), (3, 3))
    mass = np.array(robot.getMassMatrix())[-2:, -2:]
    gravity = np.array(robot.getGravityForces((0, 9.81, 0)))[-2:]

    model = pin.buildModelFromXML(text)
    model.gravity.linear[:] = 0, 9.81, 0
    data, rest = model.createData(), np.zeros(2)
    right = np.triu(pin.crba(model, data, rest))
    right += np.triu(right, 1).T
    torque = pin.rnea(model, data, rest, rest, rest)
    return (tensor, mass, gravity), (model.inertias[2].inertia, right, torque)


agree = {}
for rpy in ((0, 30, 0), (0, -30, 0), (0, 90, 0), (20, 30, 40)):
    mine, right = load(*rpy)
    agree[rpy] = [bool(np.allclose(one, other, atol=1e-6)) for one, other in zip(mine, right)]
    print(
        f"rpy {rpy} deg: Klampt ixx {mine[0][0, 0]:.3f}, ixz {mine[0][0, 2]:+.3f}, Pinocchio"
        f" {right[0][0, 0]:.3f}, {right[0][0, 2]:+.3f}; between the axes {mine[1][0, 1]:+.3f}"
        f" and {right[1][0, 1]:+.3f} kg m^2"
    )
swapped = np.allclose(load(0, 30, 0)[0][0], load(0, -30, 0)[1][0])
print(f"tensor, mass matrix and gravity torque agree: {agree}")

as_described = (
    all(agree[rpy] == [False, False, True] for rpy in ((0, 30, 0), (0, -30, 0), (20, 30, 40)))
    and agree[0, 90, 0] == [True, True, True]
    and swapped
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
