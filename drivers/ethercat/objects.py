"""The objects of communication by CoE (ETG.1000.6 clause 5.6.7) that the driver uses, by name."""

from __future__ import annotations

from drivers.fieldbus import Entry

ASSIGNED_OUT, ASSIGNED_IN = 0x1C12, 0x1C13
"""Which mappings the outputs and the inputs of a drive consist of."""
CYCLE_OUT = Entry(0x1C32, 2, "u32", "cycle time of outputs")
CYCLE_IN = Entry(0x1C33, 2, "u32", "cycle time of inputs")
CYCLES = (CYCLE_OUT, CYCLE_IN)
SYNC_TYPES = (
    Entry(0x1C32, 1, "u16", "synchronization type of outputs"),
    Entry(0x1C33, 1, "u16", "synchronization type of inputs"),
)
BY_FRAMES, BY_SYNC0 = 1, 2
"""What they hold: outputs act as frames come, or at SYNC0."""
SYNC_TYPES_OFFERED = Entry(0x1C32, 4, "u16", "synchronization types supported")
OFFERS_SYNC0 = 0x0004
"""Bit of it."""
