"""Predictions for a plan: noise, identifiability, precision."""
