"""Checks of each recording during a run, while repetition is possible."""
