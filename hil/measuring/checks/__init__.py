"""Checks of each recording during a run, while it can be repeated, and of axis limits."""
