"""Objects that only tools read or write; those of every run are in `drivers.canopen.objects`."""

from __future__ import annotations

from drivers.fieldbus import Entry

SHUTDOWN_OPTION = Entry(0x605B, 0, "i16", "shutdown option code")
DISABLE_OPTION = Entry(0x605C, 0, "i16", "disable operation option code")
FAULT_REACTION = Entry(0x605E, 0, "i16", "fault reaction option code")
TORQUE = Entry(0x6077, 0, "i16", "torque actual value")
POLARITY = Entry(0x607E, 0, "u8", "polarity")
HOMING_METHOD = Entry(0x6098, 0, "i8", "homing method")
HOMING_SPEED = Entry(0x6099, 1, "u32", "homing speed towards the switch")
HOMING_CREEP = Entry(0x6099, 2, "u32", "homing speed towards zero")
HOMING_ACCELERATION = Entry(0x609A, 0, "u32", "homing acceleration")
FOLLOWING_ERROR = Entry(0x60F4, 0, "i32", "following error actual value")
