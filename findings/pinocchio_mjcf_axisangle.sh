#!/usr/bin/env bash
# Pinocchio (pin 4.1.0): axisangle="1 1 1 120" of an MJCF file stretches the
# link to five times its length.
#
# Input: an MJCF file of an arm with two axes, shoulder and elbow. The forearm,
# 0.6 m long, is mounted with axisangle="1 1 1 120", the turn that swaps the
# three axes of a frame; then the same with the axis written at unit length.
#
# Expected: the same robot from both, the one that MuJoCo builds. MuJoCo scales
# the axis to unit length, so any non-zero vector may be written.
#
# Seen: with the axis at unit length all agrees. With "1 1 1" the axis is used
# as it stands, and the placement of the elbow is no rotation: its determinant
# is 29. The tool is 3.2 m from the elbow instead of 0.6 m, and the shoulder's
# gravity torque is 43 N m instead of 8 N m. Neither loading, nor forward
# kinematics, nor inverse dynamics complains. With the axis "0 0 2" and 90 degrees
# the forearm is 4.8 m long. Quaternions and axes of joints that are not of unit
# length are scaled by the same parser.
#
# Documentation: MuJoCo's XML reference says that the vector may have any length.
# Pinocchio's buildModelFromMJCF: "Parse the MJCF file".
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check \
  pin==4.1.0 libpinocchio==4.1.0 mujoco==4.0.0 numpy==2.4.6
venv/bin/python - <<'EOF'
import sys

import mujoco
import numpy as np
import pinocchio as pin


def arm(orientation, elbow="0 1 0"):
    """Return determinant, forearm [m] and shoulder torque [N m], by package."""
    with open("arm.xml", "w") as file:
        file.write(f"""
<mujoco>
  <worldbody>
    <body name="upper">
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>
      <joint name="shoulder" axis="0 1 0"/>
      <body name="forearm" pos="0.4 0 0" {orientation}>
        <inertial pos="0.3 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
        <joint name="elbow" axis="{elbow}"/>
        <site name="tool" pos="0.6 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
""")
    reference = mujoco.MjModel.from_xml_path("arm.xml")
    state = mujoco.MjData(reference)
    mujoco.mj_forward(reference, state)
    right = np.linalg.norm(state.site_xpos[0] - state.xpos[2]), state.qfrc_bias[0]

    model = pin.buildModelFromMJCF("arm.xml")
    data, zero = model.createData(), np.zeros(model.nv)
    pin.framesForwardKinematics(model, data, zero)
    tool, elbow = (data.oMf[model.getFrameId(name)] for name in ("tool", "elbow"))
    torque = pin.rnea(model, data, zero, zero, zero)[0]
    found = np.linalg.norm(tool.translation - elbow.translation), torque
    return np.linalg.det(model.jointPlacements[2].rotation), right, found


UNIT = 1 / np.sqrt(3)
CASES = {
    "as written": 'axisangle="1 1 1 120"',
    "unit axis": f'axisangle="{UNIT} {UNIT} {UNIT} 120"',
    "other axis": 'axisangle="0 0 2 90"',
    "quaternion": 'quat="1 1 1 1"',
}
results = {label: arm(orientation) for label, orientation in CASES.items()}
results["joint"] = arm("", elbow="0 2 0")
for label, (determinant, right, found) in results.items():
    print(
        f"{label:10s}: determinant {determinant:.2f}, forearm {right[0]:.2f} m in MuJoCo, {found[0]:.2f} m"
        f" in Pinocchio, shoulder torque {right[1]:.1f} and {found[1]:.1f} N m"
    )

agree = {label: np.allclose(right, found) for label, (_, right, found) in results.items()}
determinant, right, found = results["as written"]
as_described = (
    agree == dict(zip(results, (False, True, False, True, True)))
    and 28 < determinant < 30
    and 3.1 < found[0] < 3.3
    and found[1] / right[1] > 5
    and np.isclose(results["other axis"][2][0], 4.8)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
