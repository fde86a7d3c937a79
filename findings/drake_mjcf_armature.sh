#!/usr/bin/env bash
# Drake 1.51.1: an MJCF file without actuators loses the armature of every joint.
#
# Input: an MJCF file of a vertical axis with a link inertia of 0.10 kg m^2 and
# armature = 0.50 kg m^2, a reflected rotor inertia of usual size; first without
# <actuator>, as in robot files that leave the motors to the file of the scene, then
# with one <motor>.
#
# Expected: 0.60 kg m^2 from both, as MuJoCo computes. In MJCF the armature is an
# attribute of the joint and independent of the actuators.
#
# Seen: with the motor 0.60, without it 0.10 kg m^2: 83 % of the torque of an
# acceleration is missing. The damping of the joint is kept in both. Drake stores the
# armature in the actuator; without an actuator the armature is dropped, and no
# warning names it, while the dry friction in the same element does cause a warning.
# A joint driven by a tendon, as in many hands, loses its armature too. Drake 1.58.0,
# for newer versions of Python, does the same.
#
# Documentation: the guide to parsing says of MJCF that "the parser does log warnings
# for any unsupported MuJoCo XML elements or attributes at runtime" and lists the
# ones that it ignores silently; the armature is not in that list.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check drake==1.51.1 mujoco==4.0.0 numpy==2.4.6
venv/bin/python -W ignore - <<'EOF'
import logging
import sys

import mujoco
import numpy as np
import pydrake.all as drake

LINK, ARMATURE, DAMPING = 0.1, 0.5, 0.7
MJCF = """
<mujoco model="axis">
  <worldbody>
    <body name="table">
      <joint name="axis" axis="0 0 1" armature="{armature}" damping="{damping}" frictionloss="1.5"/>
      <inertial pos="0 0 0" mass="2" diaginertia="{link} {link} {link}"/>
      <site name="rim" pos="0.1 0 0"/>
    </body>
    <site name="post" pos="0 0.3 0"/>
  </worldbody>
  {rest}
</mujoco>
"""
RESTS = {
    "no actuator": "",
    "motor on the joint": '<actuator><motor name="motor" joint="axis"/></actuator>',
    "motor on a tendon": """
      <tendon><spatial name="cable"><site site="rim"/><site site="post"/></spatial></tendon>
      <actuator><motor name="motor" tendon="cable"/></actuator>
    """,
}
records = []
handler = logging.Handler(logging.WARNING)
handler.emit = lambda record: records.append(record.getMessage())
logging.getLogger("drake").addHandler(handler)
logging.getLogger("drake").propagate = False

found, warned = {}, {}
for label, rest in RESTS.items():
    text = MJCF.format(armature=ARMATURE, damping=DAMPING, link=LINK, rest=rest)
    records.clear()
    plant = drake.MultibodyPlant(0.0)
    drake.Parser(plant).AddModelsFromString(text, ".xml")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    torque = plant.CalcInverseDynamics(context, np.ones(1), drake.MultibodyForces(plant))[0]
    damping = plant.GetJointByName("axis").default_damping_vector()[0]

    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros(1)
    mujoco.mj_mulM(model, data, mass, np.ones(1))

    found[label] = torque, mass[0], damping
    warned[label] = [name for name in ("armature", "frictionloss") if name in " ".join(records)]
    print(
        f"{label:18s}: Drake {torque:.2f}, MuJoCo {mass[0]:.2f} N m for 1 rad/s^2;"
        f" damping {damping}; warnings name {warned[label]}"
    )

whole = LINK + ARMATURE
as_described = (
    all(np.isclose(mass, whole) and damping == DAMPING for _, mass, damping in found.values())
    and np.isclose(found["motor on the joint"][0], whole)
    and all(np.isclose(found[label][0], LINK) for label in ("no actuator", "motor on a tendon"))
    and all(names == ["frictionloss"] for names in warned.values())
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
