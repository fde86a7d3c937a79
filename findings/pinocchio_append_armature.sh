#!/usr/bin/env bash
# Pinocchio (pin 4.1.0): appending a hand to an arm removes the armature of both.
#
# Input: an arm of two axes with armature 0.5 and 0.3 kg m^2, reflected rotor
# inertias of usual size behind gears, and a hand of one axis with armature
# 0.02 kg m^2; both from URDF. appendModel puts the hand on the last link.
#
# Expected: the armatures of the new model are 0.5, 0.3 and 0.02. appendModel
# keeps damping, dry friction, gear ratio, rotor inertia and all limits of both
# models, and buildReducedModel of the same package keeps armatures.
#
# Seen: all armatures are zero, without a word. The inertia about axis 2 is
# 0.35 kg m^2 without the hand and 0.20 with it, where 0.50 is right; an
# acceleration of axis 2 alone gets 40 % of the torque it needs. Rotor inertias
# and gear ratios are still there, and gravity torques are right, so a look at the
# fields and tests at standstill pass.
#
# Documentation: "Append a child model into a parent model, after a specific
# frame". That one field of both models is left out is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check pin==4.1.0 libpinocchio==4.1.0 numpy==2.4.6
venv/bin/python - <<'EOF'
import sys

import numpy as np
import pinocchio as pin

FIELDS = ("damping", "friction", "rotorInertia", "rotorGearRatio", "upperEffortLimit")


def chain(prefix, masses):
    """Return a URDF of links in a row, one axis each."""
    parts = [f'<robot name="{prefix}"><link name="{prefix}0"/>']
    for number, mass in enumerate(masses, 1):
        parts.append(f"""
<link name="{prefix}{number}">
  <inertial>
    <origin xyz="0.2 0 0"/>
    <mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
  </inertial>
</link>
<joint name="{prefix}_axis{number}" type="revolute">
  <parent link="{prefix}{number - 1}"/>
  <child link="{prefix}{number}"/>
  <origin xyz="{0.4 if number > 1 else 0} 0 0"/>
  <axis xyz="0 1 0"/>
  <limit lower="-3" upper="3" velocity="2" effort="{40 + number}"/>
  <dynamics damping="0.7" friction="1.5"/>
</joint>""")
    return "".join([*parts, "</robot>"])


def build(prefix, masses, armature):
    """Return the model with armatures, rotor inertias and gear ratios."""
    model = pin.buildModelFromXML(chain(prefix, masses))
    model.armature = np.array(armature)
    model.rotorGearRatio = np.full(model.nv, 100.0)
    model.rotorInertia = model.armature / model.rotorGearRatio**2
    return model


def inertia(model):
    """Return the mass matrix, stretched out."""
    upper = np.triu(pin.crba(model, model.createData(), np.zeros(model.nv)))
    return upper + np.triu(upper, 1).T


arm = build("arm", [2.0, 1.0], [0.5, 0.3])
hand = build("hand", [0.4], [0.02])
flange = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.0]))
both = pin.appendModel(arm, hand, arm.getFrameId("arm2"), flange)

kept = {
    name: np.array_equal(getattr(both, name), np.concatenate([getattr(arm, name), getattr(hand, name)]))
    for name in FIELDS
}
reduced = pin.buildReducedModel(arm, [1], np.zeros(arm.nv)).armature
alone, found = inertia(arm)[1, 1], inertia(both)[1, 1]
right = found + arm.armature[1]
print(f"armature: arm {arm.armature}, hand {hand.armature}, both {both.armature} kg m^2")
print(f"kept by appendModel: {kept}")
print(f"armature of the arm reduced to axis 2: {reduced} kg m^2")
print(f"inertia about axis 2: arm {alone:.2f}, both {found:.2f}, right {right:.2f} kg m^2")

as_described = (
    not np.any(both.armature)
    and all(kept.values())
    and np.array_equal(reduced, arm.armature[1:])
    and np.isclose(alone, 0.35)
    and np.isclose(found, 0.204)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
