"""The plots of reports, and those that other commands write."""

VALIDATION = "validation.png"
"""Picture of a validation, in the folder of the run that was predicted."""
