#!/usr/bin/env bash
# Pinocchio (pin 4.1.0): the direction and size of gravity stated in an MJCF file
# are ignored.
#
# Input: a pendulum of 2 kg on a wall, with <option gravity="9.81 0 0"/>, and the
# same with the gravity of the Moon. An MJCF file states the mounting of a robot
# this way; a URDF cannot, and its users set model.gravity themselves.
#
# Expected: the gravity torque of MuJoCo, 4.7 N m at 0.3 rad on the wall.
#
# Seen: model.gravity is (0, 0, -9.81) whatever the file says: on the wall the
# torque is 1.5 N m, on the Moon six times too large. Masses and mass matrix are right,
# so a test that compares these finds nothing. Loading gives no warning.
#
# Documentation: MuJoCo's XML reference states gravity in option. Pinocchio's
# buildModelFromMJCF: "Parse the MJCF file given in input and return a pinocchio
# Model", without a list of what is left out.
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

MJCF = """
<mujoco model="pendulum">
  <option gravity="{gravity}"/>
  <worldbody>
    <body name="rod">
      <joint name="joint" axis="0 1 0"/>
      <inertial pos="0 0 0.25" mass="2" diaginertia="0.05 0.05 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""
ANGLE = np.array([0.3])
MOUNTED = {"floor": "0 0 -9.81", "wall": "9.81 0 0", "Moon": "0 0 -1.62"}


def by_pinocchio(text):
    """Return gravity [m/s^2], inertia [kg m^2] and gravity torque [N m]."""
    with open("pendulum.xml", "w") as file:
        file.write(text)
    model = pin.buildModelFromMJCF("pendulum.xml")
    data = model.createData()
    inertia = pin.crba(model, data, ANGLE)[0, 0]
    return model.gravity.linear, inertia, pin.rnea(model, data, ANGLE, 0 * ANGLE, 0 * ANGLE)[0]


def by_mujoco(text):
    """Return the same by MuJoCo."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:] = ANGLE
    mujoco.mj_forward(model, data)
    inertia = np.zeros(1)
    mujoco.mj_mulM(model, data, inertia, np.ones(1))
    return model.opt.gravity.copy(), inertia[0], data.qfrc_bias[0]


found = {}
for place, gravity in MOUNTED.items():
    text = MJCF.format(gravity=gravity)
    found[place] = mine, theirs = by_pinocchio(text), by_mujoco(text)
    print(
        f"{place:5s}: gravity {mine[0]} and {theirs[0]} m/s^2, inertia {mine[1]:.3f} and"
        f" {theirs[1]:.3f} kg m^2, torque {mine[2]:.2f} and {theirs[2]:.2f} N m (MuJoCo)"
    )
as_described = (
    all(np.allclose(mine[0], [0, 0, -9.81]) for mine, _ in found.values())
    and all(np.isclose(mine[1], theirs[1]) for mine, theirs in found.values())
    and np.isclose(found["floor"][0][2], found["floor"][1][2])
    and not np.isclose(found["wall"][0][2], found["wall"][1][2], rtol=0.5)
    and found["Moon"][0][2] / found["Moon"][1][2] > 5
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
