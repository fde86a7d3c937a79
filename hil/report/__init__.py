"""A run's report: one HTML file with its tables and pictures; and pictures of other commands."""

VALIDATION = "validation.png"
"""Picture of a validation, in the folder of the run that was predicted."""
