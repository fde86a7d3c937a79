"""Data on disk: recordings, run folders, their journals. Nothing moves here."""

SIMULATED = "sim_plant"
"""python-can's interface of the virtual plant, whose channels are named like their robots."""
