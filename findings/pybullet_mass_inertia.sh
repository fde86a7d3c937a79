#!/usr/bin/env bash
# pybullet 3.2.7: writing the mass of a link throws its inertia away.
#
# Input: a URDF of a turntable on a vertical axis, mass 2 kg, inertia 0.1 kg m^2,
# collision shape a box of 0.1 m, loaded with URDF_USE_INERTIA_FROM_FILE; then
# changeDynamics(mass=2), the mass that it has.
#
# Expected: nothing changes. With another mass, 4 kg, the inertia either stays or
# doubles.
#
# Seen: the inertia becomes 0.0033 kg m^2, that of a homogeneous box of the size
# of the collision shape; without a collision shape it becomes 0.0000013 kg m^2. A
# torque of 1 N m accelerates the table with 300 instead of 10 rad/s^2. The tensor
# of the file, asked for by the flag, is gone. So whoever tunes masses, as in
# identification or randomized training, replaces every inertia by that of the
# collision shapes. Naming localInertiaDiagonal in the same call keeps it.
#
# Documentation: the guide says of this argument "change the mass of the link",
# and of the flag that the tensor of the file is used instead of one computed
# from mass and volume of the collision shape.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check pybullet==3.2.7 numpy==2.4.6
venv/bin/python - <<'EOF'
import sys

import numpy as np
import pybullet

MASS, INERTIA, STEP = 2.0, 0.1, 1e-3
BOX = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def table(shape, **change):
    """Return inertia [kg m^2] and acceleration by 1 N m [rad/s^2] after a change."""
    with open("table.urdf", "w") as file:
        file.write(f"""
<robot name="table">
  <link name="base">
    <inertial>
      <mass value="1"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="plate">
    <inertial>
      <mass value="{MASS}"/>
      <inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    {shape}
  </link>
  <joint name="axis" type="continuous">
    <parent link="base"/>
    <child link="plate"/>
    <axis xyz="0 0 1"/>
  </joint>
</robot>
""")
    pybullet.connect(pybullet.DIRECT)
    pybullet.setTimeStep(STEP)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF("table.urdf", useFixedBase=True, flags=flags)
    if change:
        pybullet.changeDynamics(body, 0, **change)
    pybullet.setJointMotorControl2(body, 0, pybullet.VELOCITY_CONTROL, force=0)
    pybullet.setJointMotorControl2(body, 0, pybullet.TORQUE_CONTROL, force=1.0)
    pybullet.stepSimulation()
    result = pybullet.getDynamicsInfo(body, 0)[2][2], pybullet.getJointState(body, 0)[1] / STEP
    pybullet.disconnect()
    return result


results = {
    "as loaded": table(BOX),
    "same mass": table(BOX, mass=MASS),
    "twice the mass": table(BOX, mass=2 * MASS),
    "same mass, inertia named": table(BOX, mass=MASS, localInertiaDiagonal=[INERTIA] * 3),
    "same mass, no shape": table("", mass=MASS),
}
for label, (inertia, acceleration) in results.items():
    print(f"{label}: inertia {inertia:.3g} kg m^2, 1 N m accelerates with {acceleration:.4g} rad/s^2")

cube = MASS * (0.1**2 + 0.1**2) / 12
as_described = (
    np.allclose(results["as loaded"], (INERTIA, 10), rtol=0.02)
    and np.allclose(results["same mass"], (cube, 300), rtol=0.02)
    and np.isclose(results["twice the mass"][0], 2 * cube, rtol=0.02)
    and np.allclose(results["same mass, inertia named"], (INERTIA, 10), rtol=0.02)
    and results["same mass, no shape"][0] < 1e-5
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
