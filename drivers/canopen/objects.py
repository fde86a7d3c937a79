"""The objects of CiA 301, communication, that the driver reads or writes, by name."""

from __future__ import annotations

from drivers.fieldbus import Entry

DEVICE_TYPE = Entry(0x1000, 0, "u32", "device type")
SYNC_COB_ID = Entry(0x1005, 0, "u32", "COB-ID of SYNC")
CYCLE_PERIOD = Entry(0x1006, 0, "u32", "communication cycle period")
GUARD_TIME = Entry(0x100C, 0, "u16", "guard time")
LIFE_TIME_FACTOR = Entry(0x100D, 0, "u8", "life time factor")
EMERGENCY_COB_ID = Entry(0x1014, 0, "u32", "COB-ID of emergencies")
CONSUMER_HEARTBEAT = Entry(0x1016, 1, "u32", "consumer heartbeat time")
PRODUCER_HEARTBEAT = Entry(0x1017, 0, "u16", "producer heartbeat time")
VENDOR = Entry(0x1018, 1, "u32", "vendor")
PRODUCT = Entry(0x1018, 2, "u32", "product code")
REVISION = Entry(0x1018, 3, "u32", "revision number")
SERIAL = Entry(0x1018, 4, "u32", "serial number")
SET_POINT_TRANSMISSION = Entry(0x1401, 2, "u8", "transmission type of RPDO 2")
IDENTITY = (VENDOR, PRODUCT, REVISION, SERIAL)
SYNC_COUNTER = Entry(0x1019, 0, "u8", "synchronous counter overflow value")
