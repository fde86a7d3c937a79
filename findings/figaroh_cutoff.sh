#!/usr/bin/env bash
# FIGAROH 1.0.2: a low-pass filter of 100 Hz cuts off at 25 Hz.
#
# Input: sines of 10 to 100 Hz, sampled at 1 kHz, through low_pass_filter_data
# with ts = 0.001 and cut_off_frequency_butterworth = 100.
#
# Expected: 50 Hz passes with a gain of 0.999 and 100 Hz is halved. The filter is
# a Butterworth filter of order 5 that runs forwards and backwards, so its gain is
# 1/2 at the cut-off frequency.
#
# Seen: 25 Hz is halved, 50 Hz has a gain of 0.001 and 100 Hz is gone. The
# frequency is multiplied by ts / 2 where twice ts would refer it to half the
# sampling rate, so it is a quarter of what is asked for, at every sampling rate.
# Excitation between 25 and 100 Hz disappears from positions, velocities and
# torques alike, so no signal contradicts another. A cut-off above half the
# sampling rate, which the filter design would refuse, is accepted.
#
# Documentation: "cut_off_frequency_butterworth: Cutoff frequency in Hz".
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check \
  figaroh==1.0.2 pin==4.1.0 numpy==2.4.6 scipy==1.17.1 pandas==3.1.1
venv/bin/python -W ignore - <<'EOF'
import sys

import numpy as np
from figaroh.identification.identification_tools import low_pass_filter_data


def gain(frequency, step, cutoff):
    """Return amplitude after over before the filter, far from both ends."""
    times = np.arange(10000) * step
    sine = np.sin(2 * np.pi * frequency * times)
    settings = {"ts": step, "cut_off_frequency_butterworth": cutoff}
    filtered = low_pass_filter_data(sine[:, None], settings)[:, 0]
    # the filter removes as many samples in front as at the end
    removed = (len(sine) - len(filtered)) // 2
    inside = slice(2000, 8000)
    return np.std(filtered[2000 - removed : 8000 - removed]) / np.std(sine[inside])


gains = {frequency: gain(frequency, 0.001, 100) for frequency in (10, 25, 50, 100)}
for frequency, value in gains.items():
    print(f"cut-off 100 Hz, sampled at 1 kHz: gain at {frequency} Hz {value:.2g}")
other = gain(50, 0.0005, 200)
above = gain(150, 0.001, 600)
print(f"cut-off 200 Hz, sampled at 2 kHz: gain at 50 Hz {other:.2g}")
print(f"cut-off 600 Hz, sampled at 1 kHz: gain at 150 Hz {above:.2g}")

as_described = (
    gains[10] > 0.99
    and np.isclose(gains[25], 0.5, atol=0.01)
    and gains[50] < 0.002
    and gains[100] < 1e-4
    and np.isclose(other, 0.5, atol=0.01)
    and np.isclose(above, 0.5, atol=0.01)
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
