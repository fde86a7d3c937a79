#!/usr/bin/env bash
# canopen 2.4.1: on a drive with two axes one name means two different axes.
#
# Input: an EDS of a double-axis drive. CiA 402 gives axis 2 the objects of
# axis 1 plus 800h, so "Position actual value" is 6064h and 6864h; the vendor
# uses the names of the profile for both. TPDO 1 maps both positions.
#
# Expected: an error or a warning for an ambiguous name, or at least the same
# object from every look-up by this name.
#
# Seen: the object dictionary and SDO return axis 2 (the object read last), the
# PDO returns axis 1 (the entry mapped first), neither says so. A program that
# homes by SDO and then follows the PDO under the same name compares two
# different joints; writing "Target position" by name moves the wrong one. The
# number of objects in the dictionary is right, so counting does not reveal it.
#
# Documentation: access by name is shown for SDO and for PDO. That names must be
# unique in a file is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check canopen==2.4.1 python-can==4.6.1
venv/bin/python -W ignore - <<'EOF'
import logging
import sys

import canopen

NAME = "Position actual value"


def variable(section, name, data_type, default=None, access="ro"):
    """Return one section of an EDS."""
    lines = [f"[{section}]", f"ParameterName={name}", "ObjectType=7", f"DataType={data_type:#06x}"]
    lines += [f"AccessType={access}", "PDOMapping=1"]
    return "\n".join(lines + ([f"DefaultValue={default}"] if default is not None else []))


def record(index, name, count):
    """Return the head of a record of an EDS."""
    return f"[{index}]\nParameterName={name}\nObjectType=9\nSubNumber={count}"


EDS = "\n".join(
    [
        "[DeviceInfo]\nVendorName=Example\nNrOfTXPDO=1",
        variable("6064", NAME, 4),
        variable("6864", NAME, 4),
        record("1800", "TPDO communication parameter", 3),
        variable("1800sub0", "Highest sub-index supported", 5, 2),
        variable("1800sub1", "COB-ID", 7, "$NODEID+0x180", "rw"),
        variable("1800sub2", "Transmission type", 5, 1, "rw"),
        record("1A00", "TPDO mapping parameter", 3),
        variable("1A00sub0", "Number of mapped objects", 5, 2, "rw"),
        variable("1A00sub1", "Mapped object 1", 7, "0x60640020", "rw"),
        variable("1A00sub2", "Mapped object 2", 7, "0x68640020", "rw"),
    ]
)
with open("drive.eds", "w") as file:
    file.write(EDS)

records = []
handler = logging.Handler(logging.WARNING)
handler.emit = records.append
logging.getLogger().addHandler(handler)

node = canopen.RemoteNode(5, canopen.import_od("drive.eds", 5))
node.associate_network(canopen.Network())
node.tpdo[1].read(from_od=True)
found = {
    "object dictionary": node.object_dictionary[NAME].index,
    "SDO": node.sdo[NAME].index,
    "PDO": node.tpdo[1][NAME].index,
}
for way, index in found.items():
    print(f"{NAME!r} by {way}: {index:04X}h")
print(f"objects of the dictionary: {len(node.object_dictionary)}, warnings: {len(records)}")

as_described = (
    found == {"object dictionary": 0x6864, "SDO": 0x6864, "PDO": 0x6064}
    and len(node.object_dictionary) == 4
    and not records
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
