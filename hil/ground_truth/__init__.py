"""Estimates against the truth, which is known of virtual plants only."""
