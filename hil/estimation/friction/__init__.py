"""Friction from measurements at constant velocity: characteristics, models, symmetry, drift."""
