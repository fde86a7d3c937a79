"""A load at the last link, from runs without and with it."""
