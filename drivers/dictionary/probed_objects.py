"""Objects that tools only look at; those that are written are in `drivers.cia402.objects`."""

from __future__ import annotations

from drivers.fieldbus import Entry

SHUTDOWN_OPTION = Entry(0x605B, 0, "i16", "shutdown option code")
DISABLE_OPTION = Entry(0x605C, 0, "i16", "disable operation option code")
FAULT_REACTION = Entry(0x605E, 0, "i16", "fault reaction option code")
TORQUE = Entry(0x6077, 0, "i16", "torque actual value")
POLARITY = Entry(0x607E, 0, "u8", "polarity")
FOLLOWING_ERROR = Entry(0x60F4, 0, "i32", "following error actual value")
