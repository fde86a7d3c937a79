#!/usr/bin/env bash
# roboticstoolbox-python 1.4.4: the dry friction of a URDF becomes viscous.
#
# Input: a URDF with one joint, <dynamics damping="0.7" friction="1.5"/>: viscous
# 0.7 N m s/rad, dry 1.5 N m.
#
# Expected: B = 0.7 (viscous) and Tc = [1.5, -1.5] (Coulomb), the two fields that
# a Link has for exactly these. The URDF classes of the same package describe
# friction as "static friction value of the joint (... Nm for revolute)" and
# damping in N m s/rad.
#
# Seen: B = 1.5, Tc = [0, 0], and the damping is gone. With B = 1.5 N m s/rad a
# joint at 2 rad/s has 3 N m instead of 2.9, one at 0.02 rad/s 0.03 instead of
# 1.51 N m: the model creeps under any load where the machine sticks. And
# friction() returns zero at every speed for this robot: it multiplies by the
# gear ratio, which is 0 where no transmission is given.
#
# Documentation: "B: dynamic - motor viscous friction", "Tc: dynamic - motor
# Coulomb friction"; the importer's choice is not described.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check \
  roboticstoolbox-python==1.4.4 spatialmath-python==1.1.18 numpy==1.26.4
venv/bin/python -W ignore - <<'EOF'
import os
import sys

import numpy as np
from roboticstoolbox import Robot
from roboticstoolbox.models.URDF.URDFRobot import URDF_file

DAMPING, DRY = 0.7, 1.5
URDF = f"""
<robot name="one_axis">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <mass value="2"/>
      <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="axis" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
    <dynamics damping="{DAMPING}" friction="{DRY}"/>
  </joint>
</robot>
"""
with open("one_axis.urdf", "w") as file:
    file.write(URDF)

links, name, *_ = URDF_file(os.path.abspath("one_axis.urdf"))
robot = Robot(links, name=name)
link = next(link for link in robot.links if link.name == "arm")
print(f"viscous B = {link.B} N m s/rad, Coulomb Tc = {link.Tc} N m, gear ratio {link.G}")
for speed in (0.02, 2.0):
    print(f"at {speed} rad/s: URDF {DAMPING * speed + DRY:.2f} N m, B * speed {link.B * speed:.2f} N m")
returned = [float(np.ravel(robot.friction([speed]))[0]) for speed in (0.02, 2.0)]
print(f"friction() at the two speeds: {returned} N m")

as_described = link.B == DRY and not np.any(link.Tc) and link.G == 0 and not np.any(returned)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
