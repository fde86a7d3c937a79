#!/usr/bin/env bash
# canmatrix 1.3.3: conversion to SYM turns floats into integers.
#
# Input: a DBC file of a drive whose position and velocity are IEEE floats of 32 bits
# (SIG_VALTYPE_ 1), with a torque in int16 beside them; converted to a PCAN symbol
# file (.sym) and, for comparison, to KCD.
#
# Expected: floats. The format has the types float and double, canmatrix reads them
# from a .sym file, and the KCD file keeps them.
#
# Seen: the .sym file says "signed" with the same length, factor and unit. A frame
# with 1.5 rad decodes as 1 069 547 520 rad, 0 as 0; the torque is right. cantools
# writes the same DBC to SYM with float, and canmatrix reads the type float correctly,
# so only its writer loses the type. The log says nothing. Since a positive float
# grows with its bits, a wrong position still moves in the right direction.
#
# Documentation: the lists of formats for import and export name SYM without a
# remark on types.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check \
  "canmatrix[kcd]==1.3.3" cantools==45.1.0 python-can==4.6.1
venv/bin/python -W ignore - <<'EOF'
import logging
import re
import struct
import sys

import canmatrix.formats
import cantools

DBC = """VERSION ""
NS_ :
BS_:
BU_: Drive
BO_ 257 State: 8 Drive
 SG_ Position : 0|32@1- (1,0) [0|0] "rad" Drive
 SG_ Velocity : 32|32@1- (1,0) [0|0] "rad/s" Drive
BO_ 258 Load: 2 Drive
 SG_ Torque : 0|16@1- (0.1,0) [-3000|3000] "Nm" Drive
SIG_VALTYPE_ 257 Position : 1;
SIG_VALTYPE_ 257 Velocity : 1;
"""
with open("drive.dbc", "w") as file:
    file.write(DBC)

records = []
handler = logging.Handler(logging.WARNING)
handler.emit = records.append
logging.getLogger().addHandler(handler)


def decode(path):
    """Return position, velocity and torque of two frames."""
    matrix = canmatrix.formats.loadp_flat(path)
    values = {}
    for name, data in {"State": struct.pack("<ff", 1.5, -2.5), "Load": struct.pack("<h", -123)}.items():
        decoded = matrix.frame_by_name(name).decode(data)
        values |= {key: float(value.phys_value) for key, value in decoded.items()}
    return values


matrix = canmatrix.formats.loadp_flat("drive.dbc")
found = {"dbc": decode("drive.dbc")}
for suffix in ("sym", "kcd"):
    canmatrix.formats.dumpp({"": matrix}, "drive." + suffix)
    found[suffix] = decode("drive." + suffix)
with open("drive.sym") as file:
    text = file.read()
with open("float.sym", "w") as file:
    file.write(re.sub(r"Var=(Position|Velocity) signed", r"Var=\1 float", text))
found["sym, type put right"] = decode("float.sym")
for label, values in found.items():
    print(f"{label:19s}: {values['Position']:.10g} rad, {values['Velocity']:.10g} rad/s, {values['Torque']:.10g} Nm")
print("sym:", next(line for line in text.splitlines() if line.startswith("Var=Position")))

cantools.database.dump_file(cantools.database.load_file("drive.dbc"), "cantools.sym")
by_cantools = cantools.database.load_file("cantools.sym").decode_message(257, struct.pack("<ff", 1.5, -2.5))
print(f"cantools by way of SYM: {by_cantools}, warnings of canmatrix: {len(records)}")

RIGHT = {"Position": 1.5, "Velocity": -2.5, "Torque": -12.3}
as_described = (
    all(found[label] == RIGHT for label in ("dbc", "kcd", "sym, type put right"))
    and found["sym"]["Position"] == struct.unpack("<i", struct.pack("<f", 1.5))[0]
    and found["sym"]["Velocity"] == struct.unpack("<i", struct.pack("<f", -2.5))[0]
    and found["sym"]["Torque"] == RIGHT["Torque"]
    and by_cantools == {"Position": 1.5, "Velocity": -2.5}
    and not records
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
