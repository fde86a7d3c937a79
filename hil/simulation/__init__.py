"""Simulated arms that are driven as a recorded one was: how far a model's motion is from it."""
