#!/usr/bin/env bash
# npTDMS 1.13.0: appending a recording to a TDMS file moves the times of the
# recording that is there already.
#
# Input: a current of 5 s at 1 kHz that starts at 08:00:00; ten minutes later a
# second recording of 5 s at 100 Hz is appended to the same channel, each with its
# own wf_start_time and wf_increment, as data loggers do after a pause.
#
# Expected: time_track(absolute_time=True) starts at 08:00:00, has a gap of ten
# minutes and changes its step, or the call raises. The file holds start and
# increment of both: each segment carries its own.
#
# Seen: the properties of the last segment hold for all samples. The first
# recording begins at 08:10:00 and its steps are 10 ms instead of 1 ms: the
# first stroke looks ten times as slow, its accelerations are a hundred times
# too small, and the second recording starts 50 s late. No gap remains that
# could give the error away: the steps are perfectly even.
#
# Documentation: time_track "depends on the object having the wf_increment and
# wf_start_offset properties defined". What several segments mean is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check npTDMS==1.13.0 numpy==2.4.6
venv/bin/python - <<'EOF'
import sys

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

RECORDINGS = [("2026-01-01T08:00:00", 0.001, 5000), ("2026-01-01T08:10:00", 0.01, 500)]
NAME = "recordings.tdms"

for mode, (start, increment, count) in zip("wa", RECORDINGS):
    properties = {
        "wf_start_time": np.datetime64(start),
        "wf_start_offset": 0.0,
        "wf_increment": increment,
    }
    with TdmsWriter(NAME, mode=mode) as writer:
        writer.write_segment([ChannelObject("arm", "current", np.zeros(count), properties=properties)])

channel = TdmsFile.read(NAME)["arm"]["current"]
times = channel.time_track(absolute_time=True)
steps = np.diff(times) / np.timedelta64(1, "ms")
second = RECORDINGS[0][2]
late = (times[second] - np.datetime64(RECORDINGS[1][0])) / np.timedelta64(1, "s")
print(f"first sample: written {RECORDINGS[0][0]}, read {times[0]}")
print(f"first sample of the second recording: written {RECORDINGS[1][0]}, read {times[second]}")
print(f"steps: written 1 ms, a gap, 10 ms; read {steps.min():g} to {steps.max():g} ms")

as_described = (
    str(times[0]).startswith("2026-01-01T08:10:00")
    and late == 50.0
    and np.allclose(steps, 10)
    and len(times) == sum(count for *_, count in RECORDINGS)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
