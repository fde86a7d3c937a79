"""Random outages in a session of fast moves: drawn, let happen, judged."""
