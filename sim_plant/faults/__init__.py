"""Fault injection: faults of bus, drives and sensors, by plan."""
