#!/usr/bin/env bash
# canmatrix 1.3.3: conversion to ARXML rounds every factor to one decimal.
#
# Input: a DBC file of a drive with torque (0.1 Nm per bit), current (0.01 A), speed
# (0.25 rad/s) and position (2 pi / 4096 rad) in int16, and a temperature with the
# offset -40.25 degC; converted to ARXML and, for comparison, to KCD.
#
# Expected: the same physical values from both files as from the DBC, or an error.
#
# Seen: the ARXML file has the factors 0.1, 0.0, 0.2 and 0.0 and the offset -40.2. The
# speed is 20 % too small, and canmatrix reads the factors of zero as one: 2 A become
# 200 A. Every int16 is read as unsigned, since the written base type has no encoding:
# -10 Nm become 6543.6 Nm. Positive values with a factor of one decimal are right.
# Neither writing nor reading logs a warning. Version 1.2 wrote six digits and kept
# the sign.
#
# Documentation: the list of formats for export says "arxml (very basic
# implementation)"; that numbers are rounded is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check "canmatrix[arxml,kcd]==1.3.3" lxml==6.1.3
venv/bin/python -W ignore - <<'EOF'
import logging
import struct
import sys
import xml.etree.ElementTree as ET

import canmatrix.formats

DBC = """VERSION ""
NS_ :
BS_:
BU_: Drive
BO_ 257 Drive: 8 Drive
 SG_ Torque : 0|16@1- (0.1,0) [-3000|3000] "Nm" Drive
 SG_ Current : 16|16@1- (0.01,0) [-300|300] "A" Drive
 SG_ Speed : 32|16@1- (0.25,0) [-8000|8000] "rad/s" Drive
 SG_ Position : 48|16@1- (0.0015339807878856412,0) [-50|50] "rad" Drive
BO_ 258 Heat: 1 Drive
 SG_ Temperature : 0|8@1+ (0.5,-40.25) [-40|80] "degC" Drive
"""
FRAMES = {
    "forwards": {"Drive": struct.pack("<4h", 100, 200, 40, 2048), "Heat": bytes([100])},
    "backwards": {"Drive": struct.pack("<4h", -100, -200, -40, -2048), "Heat": bytes([100])},
}
with open("drive.dbc", "w") as file:
    file.write(DBC)

records = []
handler = logging.Handler(logging.WARNING)
handler.emit = records.append
logging.getLogger().addHandler(handler)


def decode(path, frames):
    """Return the physical values of all signals."""
    matrix = canmatrix.formats.loadp_flat(path)
    values = {}
    for name, data in frames.items():
        frame = matrix.frame_by_name(name) or matrix.frame_by_name("FRAME_" + name)
        decoded = frame.decode(data)
        values |= {key: float(value.phys_value) for key, value in decoded.items()}
    return values


matrix = canmatrix.formats.loadp_flat("drive.dbc")
for suffix in ("arxml", "kcd"):
    canmatrix.formats.dumpp({"": matrix}, "drive." + suffix)
found = {
    (suffix, way): decode("drive." + suffix, frames)
    for suffix in ("dbc", "kcd", "arxml")
    for way, frames in FRAMES.items()
}
for (suffix, way), values in found.items():
    print(f"{suffix:5s} {way:9s}:", ", ".join(f"{name} {value:.6g}" for name, value in values.items()))

written = {}
for method in ET.parse("drive.arxml").getroot().iter("{http://autosar.org/schema/r4.0}COMPU-METHOD"):
    space = "{http://autosar.org/schema/r4.0}"
    numbers = [number.text for number in method.find(f".//{space}COMPU-NUMERATOR").iter(space + "V")]
    written[method.find(space + "SHORT-NAME").text] = numbers
print(f"offset and factor in the ARXML file: {written}")
print(f"warnings: {len(records)}")

dbc, kcd, arxml = ({way: found[suffix, way] for way in FRAMES} for suffix in ("dbc", "kcd", "arxml"))
as_described = (
    written
    == {
        "Torque": ["0.0", "0.1"],
        "Current": ["0.0", "0.0"],
        "Speed": ["0.0", "0.2"],
        "Position": ["0.0", "0.0"],
        "Temperature": ["-40.2", "0.5"],
    }
    and all(abs(kcd[way][name] / dbc[way][name] - 1) < 1e-5 for way in FRAMES for name in dbc[way])
    and arxml["forwards"]["Torque"] == dbc["forwards"]["Torque"] == 10
    and arxml["forwards"]["Speed"] == 0.8 * dbc["forwards"]["Speed"]
    and arxml["backwards"]["Torque"] == 6543.6
    and arxml["backwards"]["Current"] == 65336
    and not records
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
