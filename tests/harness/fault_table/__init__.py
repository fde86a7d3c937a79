"""All faults of the plant over real frames: harness, cases, table."""
