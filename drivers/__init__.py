"""Servo axes on a fieldbus, behind the interface `drivers.drive_bus.DriveBus`.

The package is independent of robot dynamics. Values at the interface are on the joint side, in
SI; counts, per mille and milliamperes are internal.
"""
