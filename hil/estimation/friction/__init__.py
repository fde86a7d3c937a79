"""Friction from recordings: friction points, their symmetry, and the motion history of an axis."""
