#!/usr/bin/env bash
# DART (dartpy 6.20.0): every link of an MJCF file has an inertia of 1 kg m^2.
#
# Input: an MJCF file of a vertical axis with a rod, once with <inertial> (mass 2 kg,
# inertia 0.05 kg m^2 across) and a geom beside it, once with the geom alone, a box
# with its mass; the same rod as URDF.
#
# Expected: masses, centres of mass and tensors of the file from MjcfParser, as
# MuJoCo has them and as DART's own reader of URDF has them.
#
# Seen: masses and centres of mass are right, but the tensor of every link is the
# unit matrix, with <inertial> and without, for every shape. The inertia about the
# axis is 1.08 instead of 0.13 kg m^2, so an acceleration takes eight times the
# torque, while weight and gravity torques are right: tests at standstill pass. A
# body with <inertial> but without a geom weighs 1 kg, with its centre of mass at the
# origin. The URDF of the rod is read correctly. No warning is given. dartpy 6.20.3,
# for newer versions of Python, does the same.
#
# Documentation: MuJoCo's XML reference says that <inertial> states mass and inertia
# and that they are inferred from the geoms without it. MjcfParser.readWorld has a
# signature and no description.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check dartpy==6.20.0 mujoco==4.0.0 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF'
import os
import sys

import dartpy
import mujoco
import numpy as np

INERTIAL = '<inertial pos="0.2 0 0" mass="2" diaginertia="0.002 0.05 0.05"/>'
GEOM = '<geom type="box" pos="0.2 0 0" size="0.2 0.02 0.02" mass="2"/>'
BODIES = {"inertial and geom": INERTIAL + GEOM, "geom": GEOM, "inertial": INERTIAL}
AXES = {"vertical": "0 0 1", "horizontal": "0 1 0"}
MJCF = """
<mujoco model="rod">
  <worldbody>
    <body name="rod"><joint name="axis" axis="{axis}"/>{body}</body>
  </worldbody>
</mujoco>
"""
URDF = """
<robot name="rod">
  <link name="world"/>
  <link name="rod">
    <inertial>
      <origin xyz="0.2 0 0"/>
      <mass value="2"/>
      <inertia ixx="0.002" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="axis" type="revolute">
    <parent link="world"/>
    <child link="rod"/>
    <axis xyz="{axis}"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
  </joint>
</robot>
"""


def write(name, text):
    """Write a file and return its absolute path."""
    with open(name, "w") as file:
        file.write(text)
    return os.path.abspath(name)


def evaluate(skeleton):
    """Return inertia about the axis and gravity torque."""
    return skeleton.getMassMatrix()[0, 0], -skeleton.getGravityForces()[0]


def load_mjcf(body, axis):
    """Return the rod of an MJCF file as DART and as MuJoCo read it."""
    text = MJCF.format(axis=axis, body=body)
    world = dartpy.utils.MjcfParser.readWorld("file://" + write("rod.xml", text))
    skeleton = world.getSkeleton(0)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros(1)
    mujoco.mj_mulM(model, data, mass, np.ones(1))
    tensor = np.array(skeleton.getBodyNode("rod").getInertia().getMoment())
    return evaluate(skeleton), (mass[0], -data.qfrc_bias[0]), tensor


inertia, gravity, tensors = {}, {}, {}
for label, body in BODIES.items():
    mine, theirs, tensors[label] = load_mjcf(body, AXES["vertical"])
    inertia[label] = mine[0], theirs[0]
    mine, theirs, _ = load_mjcf(body, AXES["horizontal"])
    gravity[label] = abs(mine[1]), abs(theirs[1])
    print(
        f"MJCF, {label:17s}: inertia about the axis {inertia[label][0]:.3f} (MuJoCo {inertia[label][1]:.3f})"
        f" kg m^2, gravity torque {gravity[label][0]:.2f} (MuJoCo {gravity[label][1]:.2f}) N m"
    )
loader = dartpy.utils.DartLoader()
urdf = evaluate(loader.parseSkeleton(write("rod.urdf", URDF.format(axis=AXES["vertical"]))))[0]
print(f"URDF: inertia about the axis {urdf:.3f} kg m^2")

STEINER = 2 * 0.2**2
as_described = (
    all(np.array_equal(tensor, np.eye(3)) for tensor in tensors.values())
    and all(np.isclose(inertia[label][0], 1 + STEINER) for label in ("inertial and geom", "geom"))
    and np.isclose(inertia["inertial and geom"][1], 0.05 + STEINER)
    and all(np.isclose(*gravity[label]) for label in ("inertial and geom", "geom"))
    and np.isclose(inertia["inertial"][0], 1.0)
    and gravity["inertial"][0] < 1e-9
    and np.isclose(urdf, 0.05 + STEINER)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
