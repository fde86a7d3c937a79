"""Estimate base parameters with uncertainty from recordings, without files, terminal or bus."""
