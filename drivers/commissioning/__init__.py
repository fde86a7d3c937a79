"""Commissioning: requirements on drives, comparison with the drives file, and configuration."""
