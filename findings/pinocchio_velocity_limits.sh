#!/usr/bin/env bash
# Pinocchio (pin 4.1.0): the lower velocity limit of a URDF joint is positive.
#
# Input: a URDF with one revolute joint, <limit velocity="2" effort="50"/> and
# <dynamics friction="1.5"/>.
#
# Expected: lowerVelocityLimit = -2 rad/s. A URDF states one bound on the
# magnitude of the speed, and the same importer mirrors the two other bounds of
# this kind: the lower bounds of effort and of dry friction become -50 and -1.5.
#
# Seen: lowerVelocityLimit = +2 rad/s, equal to the upper limit. The permitted
# interval is a single point. Clipping a speed of 0.5 rad/s, or a standstill,
# to [lower, upper] returns 2 rad/s, full speed; a test "inside the limits"
# fails for nearly every sample of a recording; a box constraint
# lower <= v <= upper leaves an optimizer full speed alone.
#
# Documentation: the binding calls the field "Joint min velocity.", the header
# "Vector of minimal joint velocities". A sign is not mentioned.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check pin==4.1.0 libpinocchio==4.1.0 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF'
import sys

import numpy as np
import pinocchio as pin

URDF = """
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
    <dynamics friction="1.5"/>
  </joint>
</robot>
"""

model = pin.buildModelFromXML(URDF)
pairs = {
    "effort": (model.lowerEffortLimit[0], model.upperEffortLimit[0]),
    "dry friction": (model.lowerDryFrictionLimit[0], model.upperDryFrictionLimit[0]),
    "velocity": (model.lowerVelocityLimit[0], model.upperVelocityLimit[0]),
}
for name, (lower, upper) in pairs.items():
    print(f"{name:13s} lower {lower:6.1f}  upper {upper:6.1f}")

lower, upper = pairs["velocity"]
speeds = np.array([-1.0, 0.0, 0.5])
clipped = np.clip(speeds, lower, upper)
print(f"speeds {speeds} rad/s, clipped to the limits: {clipped} rad/s")

mirrored = all(pairs[name][0] == -pairs[name][1] for name in ("effort", "dry friction"))
as_described = mirrored and lower == upper == 2.0 and (clipped == 2.0).all()
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
