#!/usr/bin/env bash
# canopen 2.4.1: editing a value of a DCF and exporting it writes the old value.
#
# Input: a DCF of a drive with two parameters: "Following error window" (6065h),
# configured by ParameterValue=2000, and "Max profile velocity" (607Fh), which
# has a default only.
#
# Expected: import_od, set `value` of both objects, export_od as DCF: the new
# file has both new values. `value` is documented as the value that the object
# dictionary stores; it is what reads back and what a local node answers with.
#
# Seen: 607Fh is written with its new value, 6065h with the old one, 2000. The
# importer keeps the text of the file beside the number (`value_raw`), and the
# exporter prefers that text. So exactly the parameters that somebody has
# configured before cannot be changed, while new ones can; the object in memory
# reads back the new value until the file is loaded again. A drive commissioned
# with the file keeps its old following error window. The same holds for
# `default` and `default_raw` of an EDS.
#
# Documentation: `value_raw` and `default_raw` occur in no docstring of the
# package, nor are they attributes of a variable that was not imported.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check canopen==2.4.1 python-can==4.6.1
venv/bin/python -W ignore - <<'EOF'
import sys

import canopen

DCF = """
[FileInfo]
FileName=drive.dcf
[DeviceInfo]
VendorName=Example
[DeviceComissioning]
NodeID=5
Baudrate=1000
[OptionalObjects]
SupportedObjects=2
1=0x6065
2=0x607F
[6065]
ParameterName=Following error window
ObjectType=7
DataType=0x0007
AccessType=rw
DefaultValue=500
ParameterValue=2000
[607F]
ParameterName=Max profile velocity
ObjectType=7
DataType=0x0007
AccessType=rw
DefaultValue=1000
"""
with open("drive.dcf", "w") as file:
    file.write(DCF)

dictionary = canopen.import_od("drive.dcf")
wanted = {0x6065: 50, 0x607F: 300}
for index, value in wanted.items():
    dictionary[index].value = value
in_memory = {index: dictionary[index].value for index in wanted}
canopen.export_od(dictionary, "edited.dcf")

again = canopen.import_od("edited.dcf")
written = {index: again[index].value for index in wanted}
for index in wanted:
    print(
        f"{index:04X}h: wanted {wanted[index]}, in memory {in_memory[index]},"
        f" in the exported file {written[index]}"
    )

dictionary[0x6065].value_raw = "50"
canopen.export_od(dictionary, "edited.dcf")
remedied = canopen.import_od("edited.dcf")[0x6065].value
print(f"6065h after setting value_raw as well: {remedied}")

as_described = in_memory == wanted and written == {0x6065: 2000, 0x607F: 300} and remedied == 50
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
