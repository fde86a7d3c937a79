"""What to measure, as data, and what it will take and give. Nothing moves here."""
