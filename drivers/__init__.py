"""The fieldbus: servo axes behind one seam, `drivers.drive_bus.DriveBus`.

Nothing here knows of a robot's dynamics. Everything that leaves this package is joint side and
SI; counts, per mille and milliamperes stay inside.
"""
