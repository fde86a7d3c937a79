"""Carrying out a plan on a `drivers.drive_bus.DriveBus`, and keeping what was recorded."""

REHEARSAL_SPEED = 0.2
"""Share of the velocity limits that a rehearsal does not exceed, unless asked for."""
