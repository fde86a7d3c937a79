"""Simulation of recordings by a model, and the error of the simulated motion."""
