#!/usr/bin/env bash
# yourdfpy 0.0.60: loading and writing a URDF drops gear ratios without a word.
#
# Input: a URDF with one joint that has a <transmission> with a reduction of
# 100, a <calibration> and a <safety_controller>; loaded, then written.
#
# Expected: the written file still has the three elements, or a warning says
# which ones are lost. The package has classes for all three (Transmission with
# its joints and actuators, Calibration, SafetyController), a field
# `robot.transmission`, and functions that parse and write each of them.
#
# Seen: transmissions are not loaded, and the two other elements are loaded but
# not written, so the written file has none of the three. A script that only
# renames a joint or replaces a mesh thus removes the reduction, and torques and
# currents on the motor's side are off by the factor 100 for whatever reads the
# file next. The friction and the damping of the same joint survive, but in
# memory they are text: twice the friction "1.5" is "1.51.5".
#
# Documentation: the data class declares friction and damping as
# Optional[float]; no list of elements that are skipped.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check yourdfpy==0.0.60 numpy==2.4.6
venv/bin/python -W error::UserWarning - <<'EOF'
import logging
import sys
import xml.etree.ElementTree as ET

import yourdfpy

URDF = """
<robot name="arm">
  <link name="base"/>
  <link name="arm"/>
  <joint name="axis" type="revolute">
    <parent link="base"/>
    <child link="arm"/>
    <axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" velocity="2" effort="50"/>
    <dynamics damping="0.7" friction="1.5"/>
    <calibration rising="0.1"/>
    <safety_controller k_velocity="10"/>
  </joint>
  <transmission name="gear">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="axis"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
    <actuator name="motor"><mechanicalReduction>100</mechanicalReduction></actuator>
  </transmission>
</robot>
"""
with open("arm.urdf", "w") as file:
    file.write(URDF)

records = []
handler = logging.Handler(logging.WARNING)
handler.emit = records.append
logging.getLogger().addHandler(handler)
robot = yourdfpy.URDF.load("arm.urdf")
robot.write_xml_file("written.urdf")

names = ("transmission", "mechanicalReduction", "calibration", "safety_controller", "dynamics")
counts = {name: sum(1 for _ in ET.parse("written.urdf").getroot().iter(name)) for name in names}
friction = robot.robot.joints[0].dynamics.friction
print(f"robot.transmission: {robot.robot.transmission}")
print(f"elements of the written file: {counts}")
print(f"warnings: {len(records)}")
print(f"friction in memory: {friction!r}, twice the friction: {2 * friction!r}")

lost = [name for name in names if counts[name] == 0]
as_described = (
    lost == list(names[:4])
    and robot.robot.transmission == []
    and not records
    and friction == "1.5"
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
