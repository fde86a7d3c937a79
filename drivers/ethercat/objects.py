"""The objects of communication by CoE (ETG.1000.6 clause 5.6.7) that the driver uses, by name."""

from __future__ import annotations

from drivers.fieldbus import Entry

ASSIGNED_OUT, ASSIGNED_IN = 0x1C12, 0x1C13
"""Which mappings the outputs and the inputs of a drive consist of."""
CYCLE_OUT = Entry(0x1C32, 2, "u32", "cycle time of outputs")
CYCLE_IN = Entry(0x1C33, 2, "u32", "cycle time of inputs")
CYCLES = (CYCLE_OUT, CYCLE_IN)
