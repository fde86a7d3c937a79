#!/usr/bin/env bash
# urchin 0.0.30 (successor of urdfpy): a link without <inertial> weighs 1 kg.
#
# Input: a URDF of the usual form: base, arm of 2 kg, and a frame `tool0`, a
# link without mass on a fixed joint, as nearly every robot description has.
#
# Expected: 2 kg in total, and a saved file that equals the loaded one. The URDF
# specification says that a missing <inertial> means zero mass and zero inertia,
# and ROS itself, Pinocchio and Drake read it so.
#
# Seen: base and tool0 get 1 kg and an inertia of 1 kg m^2 each; the robot
# weighs 4 kg. Loading and saving writes the invented masses into the file,
# where every other tool believes them: the gravity torque of the arm of 1 m
# length grows from 9.8 to 19.6 N m, its inertia about the axis from 0.51 to
# 2.51 kg m^2. No warning is given.
#
# Documentation: "inertial : Inertial, optional". The substitute is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check urchin==0.0.30 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF'
import sys
import xml.etree.ElementTree as ET

import urchin

URDF = """
<robot name="arm">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0.5 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="tool0"/>
  <joint name="axis" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="arm"/>
    <child link="tool0"/>
    <origin xyz="1 0 0"/>
  </joint>
</robot>
"""
with open("arm.urdf", "w") as file:
    file.write(URDF)

robot = urchin.URDF.load("arm.urdf")
masses = {link.name: float(link.inertial.mass) for link in robot.links}
robot.save("saved.urdf")


def moving(path):
    """Return gravity torque and inertia about the axis, arm stretched out."""
    lever = {"arm": 0.5, "tool0": 1.0}
    torque = inertia = 0.0
    for link in ET.parse(path).getroot().iter("link"):
        if link.find("inertial") is None or link.get("name") not in lever:
            continue
        mass = float(link.find("inertial/mass").get("value"))
        torque += 9.81 * mass * lever[link.get("name")]
        inertia += float(link.find("inertial/inertia").get("iyy")) + mass * lever[link.get("name")] ** 2
    return torque, inertia


before, after = moving("arm.urdf"), moving("saved.urdf")
print(f"masses after loading: {masses} kg, total {sum(masses.values()):.1f} kg")
print(f"gravity torque: loaded file {before[0]:.1f}, saved file {after[0]:.1f} N m")
print(f"inertia about the axis: loaded file {before[1]:.2f}, saved file {after[1]:.2f} kg m^2")

as_described = masses == {"base": 1.0, "arm": 2.0, "tool0": 1.0} and after[0] > 1.9 * before[0]
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
