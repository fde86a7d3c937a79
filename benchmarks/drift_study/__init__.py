"""Comparison of methods on many virtual plants with known truth."""
