"""A run's report: one HTML file with its tables and charts; and pages of other commands."""
