"""Execution of a plan on a `drivers.drive_bus.DriveBus`, and storage of the recordings."""

REHEARSAL_SPEED = 0.2
"""Default speed of a rehearsal, as a share of the velocity limits."""
