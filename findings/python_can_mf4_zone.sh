#!/usr/bin/env bash
# python-can 4.6.1: the times of an MF4 log move with the zone of its reader.
#
# Input: two CAN frames with timestamps of the year 2023 (seconds since 1970,
# as every interface of python-can delivers them), logged to MF4 and to BLF by a
# computer whose zone is UTC, read with the zone Asia/Tokyo.
#
# Expected: the timestamps that were written. A timestamp of python-can counts
# from 1970 in UTC; MF4 has fields for UTC and for the offset of the zone;
# the BLF log of the same library returns the same timestamps everywhere.
#
# Seen: the MF4 log comes back 32 400 s (nine hours) earlier, silently; BLF is
# exact to a microsecond. The writer stores wall-clock time and flags the file
# as local time without an offset. So the log of a cell abroad, or of a
# container whose zone is UTC, does not align with a drive's recording, and a
# log written before the change of summer time and read after it differs by an
# hour from the other logs of the same day.
#
# Documentation: the docstrings of MF4Writer and MF4Reader describe the order of
# timestamps and the compression; time zones are not mentioned.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check \
  python-can==4.6.1 asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1 tzdata==2026.6
venv/bin/python -W ignore - <<'EOF'
import os
import sys
import time

import can
from asammdf import MDF

START = 1_700_000_000.125
FRAMES = [
    can.Message(timestamp=START + k / 1000, arbitration_id=0x181, is_extended_id=False, data=[k])
    for k in range(2)
]
OFFSET = 9 * 3600


def set_zone(posix):
    """Set the zone of this process by a POSIX rule; no zone file is needed."""
    os.environ["TZ"] = posix
    time.tzset()


shifts = {}
for suffix in ("mf4", "blf"):
    name = f"log.{suffix}"
    set_zone("UTC0")
    with can.Logger(name) as logger:
        for frame in FRAMES:
            logger(frame)
    for zone, rule in (("UTC", "UTC0"), ("Tokyo", "JST-9")):
        set_zone(rule)
        with can.LogReader(name) as reader:
            shifts[suffix, zone] = [m.timestamp - f.timestamp for m, f in zip(reader, FRAMES)]
        print(f"{suffix} written in UTC, read in {zone:5s}: shifted by {shifts[suffix, zone][0]:+.6f} s")

with MDF("log.mf4") as file:
    header = file.header
    print(f"start time of the MF4 file: {header.start_time}, zone: {header.start_time.tzinfo}")
    zone_missing = header.start_time.tzinfo is None

close = lambda values, target: all(abs(v - target) < 1e-4 for v in values)
as_described = (
    zone_missing
    and close(shifts["mf4", "UTC"], 0)
    and close(shifts["mf4", "Tokyo"], -OFFSET)
    and close(shifts["blf", "UTC"], 0)
    and close(shifts["blf", "Tokyo"], 0)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
