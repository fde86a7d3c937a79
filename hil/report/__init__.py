"""A run's report: one HTML file with its tables and pictures."""
