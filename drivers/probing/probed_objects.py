"""Objects that only probing reads or writes; those of every run are in `drivers.objects`."""

from __future__ import annotations

from drivers.sdo import Entry

MAX_CURRENT = Entry(0x6073, 0, "u16", "max current")
HOME_OFFSET = Entry(0x607C, 0, "i32", "home offset")
POLARITY = Entry(0x607E, 0, "u8", "polarity")
GEAR_MOTOR = Entry(0x6091, 1, "u32", "motor revolutions of the gear")
GEAR_SHAFT = Entry(0x6091, 2, "u32", "shaft revolutions of the gear")
FEED = Entry(0x6092, 1, "u32", "feed")
FEED_SHAFT = Entry(0x6092, 2, "u32", "shaft revolutions of the feed")
HOMING_METHOD = Entry(0x6098, 0, "i8", "homing method")
HOMING_SPEED = Entry(0x6099, 1, "u32", "homing speed towards the switch")
HOMING_CREEP = Entry(0x6099, 2, "u32", "homing speed towards zero")
HOMING_ACCELERATION = Entry(0x609A, 0, "u32", "homing acceleration")
FOLLOWING_ERROR = Entry(0x60F4, 0, "i32", "following error actual value")
