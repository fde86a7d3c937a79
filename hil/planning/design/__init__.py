"""Design of plans by counts, by time, for friction, and for conventional identification."""
