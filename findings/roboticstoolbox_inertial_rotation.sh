#!/usr/bin/env bash
# roboticstoolbox-python 1.4.4: the rotation of an inertial frame is ignored.
#
# Input: a rod in a URDF, turning about y, with inertia 0.05 kg m^2 about its own
# axis and 0.50 across, written twice: with the tensor in axes of the link, and
# with the tensor in axes of the rod and <origin rpy="0 0 pi/2"/>, as exporters
# of CAD systems write principal axes.
#
# Expected: the two files describe the same body, so the mass matrix of both is
# 0.50 kg m^2. The specification of URDF puts the tensor into the frame of
# <origin>.
#
# Seen: 0.50 and 0.05 kg m^2, a factor of ten. The importer takes xyz of the
# origin and the tensor as it stands and never reads rpy. Torques, accelerations
# and every simulation of a robot whose file states principal axes are wrong,
# while its kinematics, masses and gravity torques are right, so tests at
# standstill pass. Version 1.5.0 reads rpy and gives 0.50 kg m^2 for both files.
#
# Documentation: the docstrings of the importer and of Link.I say nothing about
# the rotation of the inertial frame.
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


def load(rpy, ixx, iyy):
    """Return mass matrix and gravity torque of a rod, one axis about y."""
    with open("rod.urdf", "w") as file:
        file.write(f"""
<robot name="rod">
  <link name="base"/>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 0.2" rpy="{rpy}"/>
      <mass value="1"/>
      <inertia ixx="{ixx}" iyy="{iyy}" izz="0.5" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="axis" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
</robot>
""")
    links, name, *_ = URDF_file(os.path.abspath("rod.urdf"))
    robot = Robot(links, name=name)
    mass = float(np.ravel(robot.inertia([0.0]))[0])
    return mass, abs(float(np.ravel(robot.gravload([1.0]))[0]))


STEINER = 1 * 0.2**2
link_axes = load("0 0 0", ixx=0.05, iyy=0.5)
rod_axes = load(f"0 0 {np.pi / 2}", ixx=0.5, iyy=0.05)
for label, (mass, gravity) in {"link": link_axes, "rod": rod_axes}.items():
    print(
        f"tensor in axes of the {label:4s}: about the centre of mass {mass - STEINER:.3f} kg m^2,"
        f" gravity torque {gravity:.3f} N m"
    )

as_described = (
    np.isclose(link_axes[0] - STEINER, 0.5)
    and np.isclose(rod_axes[0] - STEINER, 0.05)
    and np.isclose(link_axes[1], rod_axes[1])
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
