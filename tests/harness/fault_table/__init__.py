"""Every fault of the plant over real frames: harness, cases, table."""
