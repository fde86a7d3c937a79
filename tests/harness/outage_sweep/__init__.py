"""Random outages during fast moves: draw, execution, verdict."""
