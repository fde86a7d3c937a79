"""Carrying out a plan on a `drivers.drive_bus.DriveBus`, and keeping what was recorded."""
