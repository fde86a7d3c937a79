#!/usr/bin/env bash
# iDynTree 15.1.0: a continuous joint with a torque limit is locked at zero.
#
# Input: a URDF with a continuous joint and <limit effort="50" velocity="2"/>;
# the same without <limit>. Both are loaded and exported again.
#
# Expected: no position limits in both. In the URDF specification a continuous
# joint turns without bounds; effort and velocity are the only attributes of
# <limit> that mean something for it, and the wrists of many arms are described
# like this.
#
# Seen: with <limit> the joint has position limits, both zero, and hasPosLimits
# is true. The exported file contains a revolute joint with lower="0" upper="0",
# so the next tool receives a locked axis: a simulator holds it with whatever
# torque that needs, a planner excludes every pose but one. Without <limit> the
# round trip is right, so adding a torque limit removes the motion.
#
# Documentation: the docstrings of ModelLoader and ModelExporter do not mention
# continuous joints.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check idyntree==15.1.0 numpy==1.26.4
venv/bin/python - <<'EOF'
import sys
import xml.etree.ElementTree as ET

import idyntree.bindings as idyntree

LIMIT = '<limit effort="50" velocity="2"/>'
BODY = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def round_trip(limit):
    """Return the limits of the loaded joint and the exported joint."""
    loader = idyntree.ModelLoader()
    loader.loadModelFromString(f"""
<robot name="wrist">
  <link name="base">{BODY}</link>
  <link name="hand">{BODY}</link>
  <joint name="wrist" type="continuous">
    <parent link="base"/>
    <child link="hand"/>
    <axis xyz="0 0 1"/>
    {limit}
  </joint>
</robot>
""")
    model = loader.model()
    joint = model.getJoint(0)
    limits = joint.hasPosLimits(), joint.getMinPosLimit(0), joint.getMaxPosLimit(0)
    exporter = idyntree.ModelExporter()
    exporter.init(model)
    exporter.exportModelToFile("exported.urdf")
    exported = ET.parse("exported.urdf").find("joint")
    written = exported.find("limit")
    return limits, exported.get("type"), {} if written is None else dict(written.attrib)


free = round_trip("")
limited = round_trip(LIMIT)
for label, (limits, kind, attributes) in {"without <limit>": free, LIMIT: limited}.items():
    print(f"{label}\n  loaded: limited {limits[0]}, from {limits[1]:.3g} to {limits[2]:.3g} rad")
    print(f"  exported: {kind}, <limit> {attributes}")

as_described = (
    not free[0][0]
    and free[1] == "continuous"
    and limited[0] == (True, 0.0, 0.0)
    and limited[1] == "revolute"
    and float(limited[2]["lower"]) == float(limited[2]["upper"]) == 0.0
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
