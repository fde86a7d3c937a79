"""Data on disk: recordings, run folders, journals; without any motion."""

SIMULATED = "sim_plant"
"""Interface of the virtual plant in python-can, with channels named like their robots."""
