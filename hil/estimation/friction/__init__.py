"""Friction from recordings: points at constant velocity, and what an axis did before."""
