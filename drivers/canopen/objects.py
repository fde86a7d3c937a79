"""Communication objects of CiA 301 used by the driver, by name."""

from __future__ import annotations

from drivers.fieldbus import Entry

SYNC_COB_ID = Entry(0x1005, 0, "u32", "COB-ID of SYNC")
CYCLE_PERIOD = Entry(0x1006, 0, "u32", "communication cycle period")
GUARD_TIME = Entry(0x100C, 0, "u16", "guard time")
LIFE_TIME_FACTOR = Entry(0x100D, 0, "u8", "life time factor")
EMERGENCY_COB_ID = Entry(0x1014, 0, "u32", "COB-ID of emergencies")
CONSUMER_HEARTBEAT = Entry(0x1016, 1, "u32", "consumer heartbeat time")
PRODUCER_HEARTBEAT = Entry(0x1017, 0, "u16", "producer heartbeat time")
INHIBIT_TIME = Entry(0x1800, 3, "u16", "inhibit time of TPDO 1")
EVENT_TIMER = Entry(0x1800, 5, "u16", "event timer of TPDO 1")
SET_POINT_TRANSMISSION = Entry(0x1401, 2, "u8", "transmission type of RPDO 2")
SYNC_COUNTER = Entry(0x1019, 0, "u8", "synchronous counter overflow value")

SYNC, NMT = 0x80, 0x00
"""Identifiers of the predefined connection set."""
NMT_STATES = {0x00: "boot-up", 0x04: "stopped", 0x05: "operational", 0x7F: "pre-operational"}
"""States shown by heartbeats."""
OFF, NO_REMOTE, EXTENDED = 1 << 31, 1 << 30, 1 << 29
"""Bits of a COB-ID: PDO does not exist, no remote frame allowed, extended frame."""
IDENTIFIER = 0x7FF
ON_REQUEST = (252, 253)
"""Transmission types of a TPDO on request."""
LAST_SYNCHRONOUS = 240
