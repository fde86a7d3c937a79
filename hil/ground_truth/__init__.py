"""Comparison of models with each other, and of estimates with the truth of a virtual plant."""
