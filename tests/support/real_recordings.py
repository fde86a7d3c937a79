"""Public recordings of two real machines, if available; the docs state their sources."""

from __future__ import annotations

from pathlib import Path

import pytest

DATA = (Path(__file__).parents[2] / "../shared/data").resolve()
at_hand = pytest.mark.skipif(not DATA.is_dir(), reason="recordings of EMPS and TX40 are not here")

EMPS = f"""
robot: emps
files: [{DATA}/emps/estimation.csv.gz]
time: {{column: t, unit: s}}
joints:
  - position: {{column: q, unit: m}}
    torque: {{column: u, unit: V, gain: 35.15065188}}
kind: {{back_and_forth: 1}}
"""
"""Map of the carriage that moves back and forth."""
