#!/usr/bin/env bash
# Pinocchio (pin 4.1.0): the Euler angles of an MJCF file turn about moving axes
# where the file says fixed ones.
#
# Input: an arm of two axes, its forearm mounted at 20, 30 and 40 degrees, written
# three times: as MJCF with eulerseq="XYZ", as MJCF with a quaternion, and as
# URDF with rpy. eulerseq="XYZ" is what one writes to keep the angles of a URDF.
#
# Expected: the same robot from all three, identical to MuJoCo's. In eulerseq a
# capital letter is a rotation about a fixed axis, a small letter a rotation about a
# moving axis. Letters other than xyz and XYZ raise an error, so the parser knows
# capitals.
#
# Seen: the quaternion and the URDF agree with MuJoCo; with eulerseq="XYZ" the
# forearm is turned by 26 degrees, as if "xyz" were written. The gravity torque of
# the elbow is 2.8 instead of 3.9 N m, that of the shoulder differs by 2 % only.
# "ZYX" and mixed letters are read as small letters too. With one non-zero angle, as
# for most links of an arm, the result is right. Loading gives no warning.
#
# Documentation: MuJoCo's XML reference says what capitals mean and that rpy of
# URDF corresponds to "XYZ". Pinocchio's buildModelFromMJCF: "Parse the MJCF file".
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check pin==4.1.0 mujoco==4.0.0 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF'
import sys

import mujoco
import numpy as np
import pinocchio as pin

ANGLES = 20, 30, 40
MJCF = """
<mujoco model="arm">
  <compiler angle="degree" eulerseq="{order}"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0"/>
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
      <body name="fore" pos="0.4 0 0" {mounting}>
        <joint name="elbow" axis="0 1 0"/>
        <inertial pos="0.3 0 0.3" mass="1" diaginertia="0.01 0.03 0.03"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
URDF = """
<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0.2 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="fore">
    <inertial>
      <origin xyz="0.3 0 0.3"/>
      <mass value="1"/>
      <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/>
    <child link="fore"/>
    <origin xyz="0.4 0 0" rpy="{rpy}"/>
    <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
</robot>
"""
EULER = f'euler="{" ".join(map(str, ANGLES))}"'


def evaluate(model):
    """Return mounting of the forearm, mass matrix and gravity torques."""
    data, rest = model.createData(), np.zeros(2)
    mass = np.triu(pin.crba(model, data, rest))
    gravity = pin.rnea(model, data, rest, rest, rest)
    return model.jointPlacements[2].rotation, mass, gravity


def load_mjcf(order, mounting):
    """Return the arm as Pinocchio reads the MJCF file."""
    with open("arm.xml", "w") as file:
        file.write(MJCF.format(order=order, mounting=mounting))
    return evaluate(pin.buildModelFromMJCF("arm.xml"))


def load_mujoco(order, mounting):
    """Return the arm as MuJoCo reads the same file."""
    model = mujoco.MjModel.from_xml_string(MJCF.format(order=order, mounting=mounting))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    columns = np.zeros((2, 2))
    for row, unit in enumerate(np.eye(2)):
        mujoco.mj_mulM(model, data, columns[row], unit)
    return data.xmat[2].reshape(3, 3), np.triu(columns), data.qfrc_bias.copy()


def apart(one, other):
    """Return the angle between two mountings [deg]."""
    return np.degrees(np.linalg.norm(pin.log3(one[0].T @ other[0])))


right = load_mujoco("XYZ", EULER)
turn = pin.Quaternion(pin.rpy.rpyToMatrix(*np.radians(ANGLES)))
quaternion = f'quat="{turn.w} {turn.x} {turn.y} {turn.z}"'
rpy = " ".join(str(angle) for angle in np.radians(ANGLES))
found = {
    "URDF, rpy": evaluate(pin.buildModelFromXML(URDF.format(rpy=rpy))),
    "MJCF, quat": load_mjcf("XYZ", quaternion),
    "MJCF, XYZ": load_mjcf("XYZ", EULER),
}
for label, (_, mass, gravity) in {"MuJoCo, XYZ": right, **found}.items():
    print(
        f"{label:11s}: inertia about the shoulder {mass[0, 0]:.3f} kg m^2,"
        f" gravity torque {gravity[0]:.2f} and {gravity[1]:.2f} N m"
    )
wrong = {order: apart(load_mjcf(order, EULER), load_mujoco(order, EULER)) for order in ("XYZ", "ZYX", "xYz")}
small = {order: apart(load_mjcf(order, EULER), load_mujoco(order, EULER)) for order in ("xyz", "zyx")}
as_small = apart(found["MJCF, XYZ"], load_mujoco("xyz", EULER))
single = apart(load_mjcf("XYZ", 'euler="0 0 40"'), load_mujoco("XYZ", 'euler="0 0 40"'))
for order, angle in {**wrong, **small}.items():
    print(f"eulerseq {order}: forearm {angle:.1f} deg from MuJoCo's")
print(f"XYZ against MuJoCo's xyz: {as_small:.1f} deg; XYZ with one angle only: {single:.1f} deg")

close = all(
    np.allclose(mine, theirs, atol=1e-9)
    for label in ("URDF, rpy", "MJCF, quat")
    for mine, theirs in zip(found[label], right)
)
as_described = (
    close
    and all(angle > 5 for angle in wrong.values())
    and all(angle < 1e-4 for angle in (*small.values(), as_small, single))
    and not np.allclose(found["MJCF, XYZ"][2], right[2], rtol=0.1)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
