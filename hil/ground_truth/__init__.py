"""Comparison of models, and of estimates with the truth of a virtual plant."""
