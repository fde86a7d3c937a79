#!/usr/bin/env bash
# asammdf 8.8.28: the same raster gives other values from resample() than from
# to_dataframe().
#
# Input: a current of 1 kHz, stored as most loggers do: int16 with a linear
# conversion of 0.01 A, a sine of 5 A at 10 Hz; a position in float64 beside it.
#
# Expected: MDF.resample(raster=0.0005).to_dataframe() equals
# MDF.to_dataframe(raster=0.0005). The two take the same argument, the docstring
# of to_dataframe refers to resample for it, and one configuration
# (integer_interpolation, float_interpolation) applies to both.
#
# Seen: to_dataframe() converts to amperes first and then interpolates linearly;
# resample(), get(raster=...) and hence files written by them keep the raw
# integers, and integers hold the previous value. Between the samples the two
# differ by up to 0.16 A. Held samples lag by half a sampling interval on
# average, 0.25 ms here; the float position of the same group does not.
# A model fitted to the resampled file sees a delay between position and current
# that the machine does not have. Storing the same current as float32 makes the
# delay vanish, so the delay depends on the data type of the logger.
#
# Documentation: "integer interpolation mode: repeat previous sample" is
# documented for configure(). That the data type before the conversion decides
# in one function and the one after it in the other is not.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check asammdf==8.8.28 numpy==2.4.6 pandas==3.1.1
venv/bin/python -W ignore - <<'EOF'
import sys

import numpy as np
from asammdf import MDF, Signal

times = np.arange(1000) / 1000
true = 5 * np.sin(2 * np.pi * 10 * times)
counts = np.round(true / 0.01).astype(np.int16)
recording = MDF()
recording.append(
    [
        Signal(counts, times, name="current", unit="A", conversion={"a": 0.01, "b": 0.0}),
        Signal(true, times, name="position", unit="rad"),
    ]
)

RASTER = 0.0005
direct = recording.to_dataframe(raster=RASTER)
resampled = recording.resample(raster=RASTER).to_dataframe()
length = min(len(direct), len(resampled))
direct, resampled = direct.iloc[:length], resampled.iloc[:length]
apart = {name: np.abs(direct[name] - resampled[name]).max() for name in ("current", "position")}


def delay(frame):
    """Return the delay of the current behind the position [s]."""
    wave = np.exp(-2j * np.pi * 10 * frame.index.to_numpy())
    ratio = (frame["position"] * wave).sum() / (frame["current"] * wave).sum()
    return np.angle(ratio) / (2 * np.pi * 10)


late = {"to_dataframe": delay(direct), "resample": delay(resampled)}
print(f"largest difference: current {apart['current']:.3f} A, position {apart['position']:.1e} rad")
for name, value in late.items():
    print(f"delay of the current behind the position, {name}: {value * 1e6:.0f} us")

as_described = (
    0.14 < apart["current"] < 0.18
    and apart["position"] < 1e-9
    and abs(late["to_dataframe"]) < 5e-6
    and 200e-6 < late["resample"] < 300e-6
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
