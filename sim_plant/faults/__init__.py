"""What goes wrong on purpose: faults of bus, drives and sensors, by plan."""
